//! Reading stacks and writing meshes.
#![allow(clippy::unwrap_used, clippy::float_cmp, missing_docs)]

use std::path::{Path, PathBuf};

use bgars_core::Error;
use bgars_core::io::color::read_color;
use bgars_core::io::decode::{Channel, Color};
use bgars_core::io::rgb16::write_png16;
use bgars_core::io::{MeshView, obj::write_obj, ply::write_ply};
use bgars_core::mesh::triangulate;
use bgars_suite::files::{StackData, decode_stack};
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
    let image = read_color(&path, LIMIT).unwrap();
    assert_eq!((image.height, image.width, image.channels, image.bits), (2, 3, 3, 16));
    assert!(image.data.iter().zip(&data).all(|(&found, &code)| found == f32::from(code)));
    let error = read_color(&gray(folder.path(), "g.png", 3, 2), LIMIT).unwrap_err();
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
    write_ply(&mesh, &["unit um\nelement vertex 9".to_owned()], &mut ply).unwrap();
    let end = ply.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(ply[..end].to_vec()).unwrap();
    assert!(header.contains("comment unit um element vertex 9\n"), "a line break in a comment is harmless");
    assert!(header.contains("element vertex 3\n") && header.contains("element face 1\n"));
    assert_eq!(ply.len() - end, 3 * (12 + 12 + 3) + 13);

    let mut obj = Vec::new();
    write_obj(&mesh, &[], &mut obj).unwrap();
    let obj = String::from_utf8(obj).unwrap();
    assert_eq!(obj.lines().last(), Some("f 1//1 2//2 3//3"));
    assert!(obj.contains("v 0 1 0.5 1.0000 0.0000 0.5020\n"));

    for wrong in [3, -1] {
        let error = MeshView { faces: &[[0, 1, wrong]], ..mesh }.check().unwrap_err();
        assert!(
            matches!(error, Error::OutOfRange { argument: "faces", value, .. } if value == wrong as f64),
            "{error}"
        );
    }
}

/// Vertices, faces, normals, colours.
type Mesh = (Vec<[f64; 3]>, Vec<[i64; 3]>, Vec<[f64; 3]>, Vec<[u8; 3]>);

/// A strip of `vertices` vertices with values of many lengths, and the faces between neighbours.
fn strip(vertices: u32) -> Mesh {
    let points = (0..vertices).map(|index| {
        let along = f64::from(index);
        [along - 7.5, 1e-7 * along, (along * 0.37).sin() * 10f64.powi(index as i32 % 9 - 4)]
    });
    let faces = (2..i64::from(vertices)).map(|index| [index - 2, index - 1, index]);
    let normals = (0..vertices).map(|index| {
        let angle = f64::from(index) * 0.01;
        [angle.sin(), -angle.cos(), if index % 1000 == 0 { -0.0 } else { 1.0 }]
    });
    let colors = (0..vertices).map(|index| [index as u8, (index / 256) as u8, 128]);
    (points.collect(), faces.collect(), normals.collect(), colors.collect())
}

/// The slow plain twin of `write_ply`, without its header.
fn plain_ply(mesh: MeshView<'_>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (index, vertex) in mesh.vertices.iter().enumerate() {
        for value in vertex.iter().chain(mesh.normals.map_or(&[][..], |normals| &normals[index])) {
            bytes.extend((*value as f32).to_le_bytes());
        }
        bytes.extend(mesh.colors.map_or(&[][..], |colors| &colors[index]));
    }
    for face in mesh.faces {
        bytes.push(3);
        bytes.extend(face.iter().flat_map(|&index| (index as u32).to_le_bytes()));
    }
    bytes
}

#[test]
fn mesh_files_do_not_depend_on_blocks_or_threads() {
    let block = 1 << 14;
    for count in [3, block - 1, block, block + 1, 5 * block + 2] {
        let (vertices, faces, normals, colors) = strip(count);
        for with in [false, true] {
            let (normals, colors) = (with.then_some(&normals[..]), with.then_some(&colors[..]));
            let mesh = MeshView { vertices: &vertices, faces: &faces, normals, colors };
            let written = [1, 2, 3].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let (mut ply, mut obj) = (Vec::new(), Vec::new());
                pool.install(|| write_ply(&mesh, &[], &mut ply).and_then(|()| write_obj(&mesh, &[], &mut obj)))
                    .unwrap();
                (ply, obj)
            });
            assert!(written[0] == written[1] && written[0] == written[2], "{count} vertices");
            let (ply, obj) = &written[0];
            assert!(ply.ends_with(&plain_ply(mesh)), "{count} vertices");
            check_obj(std::str::from_utf8(obj).unwrap(), mesh);
        }
    }
}

/// Reads every line back: coordinates bit for bit, normals and colours to their digits.
fn check_obj(text: &str, mesh: MeshView<'_>) {
    let mut lines = text.lines();
    let numbers = |line: &str| -> Vec<f32> { line.split(' ').skip(1).map(|word| word.parse().unwrap()).collect() };
    for (index, vertex) in mesh.vertices.iter().enumerate() {
        let read = numbers(lines.next().unwrap());
        assert_eq!(read[..3], vertex.map(|value| value as f32));
        for (read, level) in read[3..].iter().zip(mesh.colors.map_or([0; 3], |colors| colors[index])) {
            assert!((read * 255.0 - f32::from(level)).abs() < 0.02, "vertex {index}");
        }
        assert_eq!(read.len(), if mesh.colors.is_some() { 6 } else { 3 });
    }
    for normal in mesh.normals.into_iter().flatten() {
        let line = lines.next().unwrap();
        let plain = normal.map(|value| format!("{:.6}", value as f32)).join(" ");
        assert_eq!(line, format!("vn {plain}"));
    }
    for face in mesh.faces {
        let [a, b, c] = face.map(|index| index + 1);
        let expected =
            if mesh.normals.is_some() { format!("f {a}//{a} {b}//{b} {c}//{c}") } else { format!("f {a} {b} {c}") };
        assert_eq!(lines.next().unwrap(), expected);
    }
    assert_eq!(lines.next(), None);
}

#[test]
fn a_mesh_that_cannot_be_written_reports_the_first_error() {
    struct Full;
    impl std::io::Write for Full {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::ErrorKind::StorageFull.into())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let (vertices, faces, ..) = strip(40_000);
    let mesh = MeshView { vertices: &vertices, faces: &faces, normals: None, colors: None };
    assert_eq!(write_ply(&mesh, &[], &mut Full).unwrap_err().kind(), std::io::ErrorKind::StorageFull);
    assert_eq!(write_obj(&mesh, &[], &mut Full).unwrap_err().kind(), std::io::ErrorKind::StorageFull);
}

#[test]
fn triangles_do_not_depend_on_threads() {
    let (width, height) = (131, 97);
    let mask: Vec<bool> = (0..width * height).map(|pixel| pixel * 7919 % 11 != 0).collect();
    let height_px: Vec<f32> = (0..width * height).map(|pixel| (pixel as f32 * 0.1).sin()).collect();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| triangulate(&height_px, &mask, width, 3.4)).unwrap()
    };
    let (one, two) = (on(1), on(2));
    assert_eq!((&one.vertices, &one.faces, &one.pixels), (&two.vertices, &two.faces, &two.pixels));
    assert_eq!(one.vertices.len(), mask.iter().filter(|&&valid| valid).count());
    assert!(one.pixels.is_sorted() && one.pixels.iter().all(|&pixel| mask[pixel as usize]));
    // Every face lies in one square of four pixels: its corners are neighbours.
    for face in &one.faces {
        let [a, b, c] = face.map(|vertex| one.pixels[vertex as usize] as usize);
        for (a, b) in [(a, b), (b, c), (c, a)] {
            assert!((a / width).abs_diff(b / width) <= 1 && (a % width).abs_diff(b % width) <= 1);
        }
    }
}
