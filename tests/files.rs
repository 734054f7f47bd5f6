//! Reading stacks and writing meshes.
#![allow(clippy::unwrap_used, clippy::float_cmp, missing_docs)]

use std::path::{Path, PathBuf};

use bgars_core::Error;
use bgars_core::io::decode::{Channel, Color, StackData, decode_stack};
use bgars_core::io::rgb16::{read_rgb16, write_png16};
use bgars_core::io::{MeshView, obj::write_obj, ply::write_ply};
use bgars_core::mesh::triangulate;
use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage};

const LIMIT: f64 = 100.0;

fn plain() -> Color<'static> {
    Color { channel: Channel::Luminance, response: None, gains: None }
}

fn gray(folder: &Path, name: &str, width: u32, height: u32) -> PathBuf {
    let path = folder.join(name);
    GrayImage::from_fn(width, height, |x, y| Luma([(10 * y + x) as u8])).save(&path).unwrap();
    path
}

#[test]
fn grey_files_of_every_format_come_back_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.png", "a.tif", "a.bmp", "a.pgm"] {
        let paths = vec![gray(folder.path(), name, 7, 5); 3];
        let stack = decode_stack(&paths, &plain(), LIMIT).unwrap();
        assert_eq!((stack.height, stack.width, stack.bits), (5, 7, 8), "{name}");
        let StackData::U8(data) = stack.data else { panic!("{name} is not 8 bit") };
        assert_eq!(data[35 + 2 * 7 + 3], 23, "{name}");
    }
}

#[test]
fn sixteen_bit_files_keep_their_bits() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.png", "a.tif"] {
        let path = folder.path().join(name);
        ImageBuffer::<Luma<u16>, Vec<u16>>::from_fn(4, 3, |x, y| Luma([(1000 * y + x) as u16])).save(&path).unwrap();
        let StackData::U16(data) = decode_stack(&[path], &plain(), LIMIT).unwrap().data else { panic!("{name}") };
        assert_eq!(data[2 * 4 + 1], 2001);
    }
}

#[test]
fn colour_is_combined_linearly_as_asked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rgb.png");
    RgbImage::from_pixel(2, 2, Rgb([100, 50, 200])).save(&path).unwrap();
    let value = |channel| {
        let color = Color { channel, ..plain() };
        let StackData::U8(data) = decode_stack(std::slice::from_ref(&path), &color, LIMIT).unwrap().data else {
            panic!()
        };
        data[0]
    };
    // 0.2126 * 100 + 0.7152 * 50 + 0.0722 * 200 = 71.46
    assert_eq!(value(Channel::Luminance), 71);
    assert_eq!(value(Channel::Mean), 117);
    assert_eq!((value(Channel::Red), value(Channel::Green), value(Channel::Blue)), (100, 50, 200));

    let response: Vec<f32> = (0..256).map(|code| code as f32 / 2.0).collect();
    let gains = [[1.0, 2.0, 0.0]];
    let color = Color { channel: Channel::Mean, response: Some(&response), gains: Some(&gains) };
    let stack = decode_stack(&[path], &color, LIMIT).unwrap();
    assert!(stack.linear);
    let StackData::F32(data) = stack.data else { panic!() };
    approx::assert_relative_eq!(data[0], 100.0 / 3.0, max_relative = 1e-6);
}

#[test]
fn files_that_do_not_fit_together_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let a = gray(folder.path(), "a.png", 7, 5);
    let b = gray(folder.path(), "b.png", 7, 6);
    let error = decode_stack(&[a.clone(), b.clone()], &plain(), LIMIT).unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, Error::StackMismatch { .. }), "{text}");
    assert!(text.contains("b.png") && text.contains("7 x 6") && text.contains("7 x 5"), "{text}");
    let deep = folder.path().join("deep.png");
    ImageBuffer::<Luma<u16>, Vec<u16>>::new(7, 5).save(&deep).unwrap();
    let text = decode_stack(&[a, deep], &plain(), LIMIT).unwrap_err().to_string();
    assert!(text.contains("deep.png") && text.contains("16 bit") && text.contains("8 bit"), "{text}");
}

#[test]
fn truncated_missing_and_foreign_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(gray(folder.path(), "a.png", 200, 200)).unwrap();
    let cut = folder.path().join("cut.png");
    std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let error = decode_stack(&[cut], &plain(), LIMIT).unwrap_err();
    assert!(matches!(error, Error::Decode { .. }) && error.to_string().contains("cut.png"), "{error}");

    let text = folder.path().join("notes.png");
    std::fs::write(&text, "not an image at all").unwrap();
    let error = decode_stack(&[text], &plain(), LIMIT).unwrap_err();
    assert!(matches!(error, Error::UnsupportedImage { .. }) && error.to_string().contains("notes.png"), "{error}");

    let error = decode_stack(&[folder.path().join("none.png")], &plain(), LIMIT).unwrap_err();
    assert!(matches!(error, Error::Io { .. }) && error.to_string().contains("none.png"), "{error}");
}

#[test]
fn a_header_that_claims_a_gigantic_size_is_refused_before_allocation() {
    let folder = tempfile::tempdir().unwrap();
    let path = gray(folder.path(), "a.png", 3, 3);
    let mut bytes = std::fs::read(&path).unwrap();
    // IHDR starts at byte 16: width, height; its checksum (over type and data) follows at byte 29.
    bytes[16..24].copy_from_slice(&[0x00, 0x01, 0x86, 0xA0, 0x00, 0x01, 0x86, 0xA0]);
    let checksum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
    std::fs::write(&path, bytes).unwrap();
    let error = decode_stack(&[path], &plain(), 256.0).unwrap_err();
    assert!(matches!(error, Error::ImageTooLarge { width: 100_000, height: 100_000, .. }), "{error}");
}

/// Bitwise CRC-32 (ISO 3309), slow and plain.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 })
    })
}

#[test]
fn sixteen_bit_rgb_survives_a_round_trip_and_grey_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("n.png");
    let data: Vec<u16> = (0..2 * 3 * 3).map(|index| index * 3001).collect();
    write_png16(&path, &data, 2, 3).unwrap();
    let image = read_rgb16(&path, LIMIT).unwrap();
    assert_eq!((image.height, image.width, image.data), (2, 3, data));
    let error = read_rgb16(&gray(folder.path(), "g.png", 3, 2), LIMIT).unwrap_err();
    assert!(error.to_string().contains("RGB"), "{error}");
    assert!(matches!(write_png16(&path, &[0; 5], 2, 3).unwrap_err(), Error::LengthMismatch { .. }));
}

#[test]
fn faces_skip_masked_pixels_and_turn_toward_the_camera() {
    let mut mask = [true; 9];
    mask[0] = false;
    let mesh = triangulate(&[0.0; 9], &mask, 3, 1.0).unwrap();
    assert_eq!(mesh.vertices.len(), 8);
    assert_eq!(mesh.faces.len(), 7, "three whole squares and one with a corner missing");
    for face in &mesh.faces {
        let [a, b, c] = face.map(|index| mesh.vertices[index as usize]);
        let cross = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        assert!(cross > 0.0, "{face:?} looks away");
    }
}

#[test]
fn ply_and_obj_say_what_they_hold() {
    let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]];
    let faces = [[0, 1, 2]];
    let normals = [[0.0, 0.0, 1.0]; 3];
    let colors = [[255, 0, 128]; 3];
    let mesh = MeshView { vertices: &vertices, faces: &faces, normals: Some(&normals), colors: Some(&colors) };
    let mut ply = Vec::new();
    write_ply(mesh, &["unit um\nelement vertex 9".to_owned()], &mut ply).unwrap();
    let end = ply.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(ply[..end].to_vec()).unwrap();
    assert!(header.contains("comment unit um element vertex 9\n"), "a line break in a comment is harmless");
    assert!(header.contains("element vertex 3\n") && header.contains("element face 1\n"));
    assert_eq!(ply.len() - end, 3 * (12 + 12 + 3) + 13);

    let mut obj = Vec::new();
    write_obj(mesh, &[], &mut obj).unwrap();
    let obj = String::from_utf8(obj).unwrap();
    assert_eq!(obj.lines().last(), Some("f 1//1 2//2 3//3"));
    assert!(obj.contains("v 0 1 0.5 1.0000 0.0000 0.5020\n"));

    let bad = MeshView { faces: &[[0, 1, 3]], ..mesh };
    assert!(matches!(bad.check().unwrap_err(), Error::OutOfRange { argument: "faces", .. }));
}
