//! The package `bgars-suite` exists for its `tests/*.rs` and `benches/*.rs`; it has no code of its own.
