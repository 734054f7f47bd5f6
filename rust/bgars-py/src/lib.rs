//! The compiled half of the Python package `bgars`: a list of functions. Every one of them releases the GIL once, around
//! the whole of its work; `python/bgars/_bgars.pyi` documents them.

mod assignment;
mod bilateral;
mod capture;
mod convert;
mod errors;
mod files;
mod integrate;
mod mesh;
mod normals;
mod pool;
mod progress;
mod reflectance;
mod rims;
mod shadows;

#[pyo3::pymodule]
mod _bgars {
    #[pymodule_export]
    use crate::assignment::assignment;
    #[pymodule_export]
    use crate::bilateral::integrate_bilateral;
    #[pymodule_export]
    use crate::capture::float_full_scale;
    #[pymodule_export]
    use crate::capture::unit_directions;
    #[pymodule_export]
    use crate::files::decode_stack;
    #[pymodule_export]
    use crate::files::read_color;
    #[pymodule_export]
    use crate::files::write_height;
    #[pymodule_export]
    use crate::files::write_mesh;
    #[pymodule_export]
    use crate::files::write_png16;
    #[pymodule_export]
    use crate::integrate::integrate_normals;
    #[pymodule_export]
    use crate::integrate::usable_normals;
    #[pymodule_export]
    use crate::mesh::triangulate;
    #[pymodule_export]
    use crate::mesh::vertex_normals;
    #[pymodule_export]
    use crate::normals::estimate_normals;
    #[pymodule_export]
    use crate::normals::predict_left_out;
    #[pymodule_export]
    use crate::reflectance::estimate_reflectance;
    #[pymodule_export]
    use crate::rims::eliminate_rims;
    #[pymodule_export]
    use crate::rims::rim_bands;
    #[pymodule_export]
    use crate::rims::rim_profiles;
    #[pymodule_export]
    use crate::rims::ring_edges;
    #[pymodule_export]
    use crate::shadows::draw_shadows;
    #[pymodule_export]
    use crate::shadows::edge_products;
    #[pymodule_export]
    use crate::shadows::edge_rows;
    #[pymodule_export]
    use crate::shadows::measure_edges;
    #[pymodule_export]
    use crate::shadows::normal_distribution;

    #[pymodule_export]
    const REFLECTANCE_MIN_LIGHTS: usize = bgars_core::reflectance::MIN_LIGHTS;
    #[pymodule_export]
    const REFLECTANCE_MAX_LOSS: f64 = bgars_core::reflectance::MAX_LOSS;
    #[pymodule_export]
    const BLIND_MIN_LIGHTS: usize = bgars_core::blind::MIN_LIGHTS;
    #[pymodule_export]
    const DEBUG_BUILD: bool = cfg!(debug_assertions);
}
