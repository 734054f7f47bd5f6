//! Files: pixels a second of reading a stack of eight images, and of writing a height map as a mesh.

#![allow(missing_docs, clippy::unwrap_used)]

use std::path::PathBuf;

use bgars_core::io::decode::{Channel, Color};
use bgars_core::io::{HeightSource, MeshFormat, MeshView, write_mesh_file};
use bgars_core::mesh::{HeightMesh, triangulate};
use bgars_suite::files::decode_stack;
use bgars_suite::masks::{rectangle, wavy_heights};
use bgars_suite::stacks::wavy;
use bgars_suite::{THREADS, keep_short, on_threads};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use image::{ImageBuffer, Luma, PixelWithColorType};

const SIDE: usize = 1024;
const LIGHTS: usize = 8;
const MAX_MEGAPIXELS: f64 = 100.0;

/// Every image of a stack once more for each pixel type and format.
fn decode<P>(criterion: &mut Criterion, dtype: &str, convert: impl Fn(f32) -> P)
where
    P: image::Primitive,
    Luma<P>: PixelWithColorType<Subpixel = P>,
    [P]: image::EncodableLayout,
{
    let folder = tempfile::tempdir().unwrap();
    let (images, _) = wavy(LIGHTS, SIDE, convert);
    for format in ["png", "tif"] {
        let save = |(light, image): (usize, &[P])| {
            let path = folder.path().join(format!("{light}.{format}"));
            let image = ImageBuffer::<Luma<P>, _>::from_raw(SIDE as u32, SIDE as u32, image.to_vec()).unwrap();
            image.save(&path).unwrap();
            path
        };
        let paths: Vec<PathBuf> = images.chunks(SIDE * SIDE).enumerate().map(save).collect();
        let color = Color { channel: Channel::Luminance, response: None, gains: None };
        let mut group = criterion.benchmark_group(format!("decode/{format} {dtype}, {LIGHTS} x {SIDE} x {SIDE}"));
        keep_short(&mut group);
        group.throughput(Throughput::Elements((LIGHTS * SIDE * SIDE) as u64));
        for threads in THREADS {
            group.bench_function(format!("{threads} threads"), |bencher| {
                on_threads(threads, || bencher.iter(|| decode_stack(&paths, &color, MAX_MEGAPIXELS).unwrap()));
            });
        }
    }
}

fn reading(criterion: &mut Criterion) {
    decode(criterion, "u8", |value| (value * 255.0) as u8);
    decode(criterion, "u16", |value| (value * 65535.0) as u16);
}

fn writing(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh");
    let (heights, mask) = (wavy_heights(SIDE), rectangle(SIDE));
    let mesh = triangulate(&heights, &mask, SIDE, 1.0).unwrap();
    let vertices: Vec<[f64; 3]> = mesh.vertices.iter().map(|vertex| vertex.map(f64::from)).collect();
    let faces: Vec<[i64; 3]> = mesh.faces.iter().map(|face| face.map(i64::from)).collect();
    let view = MeshView { vertices: &vertices, faces: &faces, normals: None, colors: None };
    let mut group = criterion.benchmark_group(format!("write/{SIDE} x {SIDE}"));
    keep_short(&mut group);
    group.throughput(Throughput::Elements((SIDE * SIDE) as u64));
    for (name, format) in [("ply", MeshFormat::Ply), ("obj", MeshFormat::Obj)] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| write_mesh_file(&view, format, &[], &path).unwrap());
        });
        group.bench_function(format!("height map to {name}"), |bencher| {
            bencher.iter(|| {
                let surface = HeightMesh::new(&heights, &mask, SIDE, 1.0).unwrap();
                let source = HeightSource::new(surface, None, None).unwrap();
                write_mesh_file(&source, format, &[], &path).unwrap();
            });
        });
    }
}

criterion_group!(benches, reading, writing);
criterion_main!(benches);
