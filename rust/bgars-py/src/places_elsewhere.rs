//! On which processors the threads of a pool run: wherever the system puts them.

/// Where the threads of a pool run.
#[derive(Default)]
pub struct Places;

#[allow(clippy::unused_self)] // as where there is something to do
impl Places {
    /// To be called once by each thread of the pool, with its number.
    pub fn enter(&self, _index: usize) {}

    /// Nothing, here.
    pub fn begin(&self, _count: usize) {}

    /// Nothing, here.
    pub fn look(&self) {}

    /// Nothing, here.
    pub fn free(&self) {}
}
