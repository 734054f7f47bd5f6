//! Which nodes of a graph become the next coarser one.

use super::matrix::Rows;
use crate::memory::Scratch;

/// A node depends strongly on a neighbour whose edge weighs at least this share of its heaviest (Ruge and Stüben 1987).
pub(super) const STRONG: f32 = 0.25;

/// Stands for a node that does not become a coarse one.
pub(super) const FINE: u32 = u32::MAX;

const COARSE: u32 = 0;
const UNDECIDED: u32 = u32::MAX - 1;
const NONE: u32 = u32::MAX;

/// The smallest weight on which each node depends strongly.
pub(super) fn strong_limits(graph: &Rows) -> Scratch<f32> {
    (0..graph.len()).map(|node| STRONG * graph.values(node).fold(f32::MIN_POSITIVE, f32::max)).collect()
}

/// Nodes in lists by how many others want them as a coarse one.
struct Ranking {
    first: Vec<u32>,
    next: Scratch<u32>,
    previous: Scratch<u32>,
    rank: Scratch<u16>,
    best: usize,
}

impl Ranking {
    fn insert(&mut self, node: usize) {
        let rank = self.rank[node] as usize;
        if rank >= self.first.len() {
            self.first.resize(rank + 1, NONE);
        }
        let next = self.first[rank];
        self.next[node] = next;
        self.previous[node] = NONE;
        if next != NONE {
            self.previous[next as usize] = node as u32;
        }
        self.first[rank] = node as u32;
        self.best = self.best.max(rank);
    }

    fn remove(&mut self, node: usize) {
        let (next, previous) = (self.next[node], self.previous[node]);
        if next != NONE {
            self.previous[next as usize] = previous;
        }
        if previous == NONE {
            self.first[self.rank[node] as usize] = next;
        } else {
            self.next[previous as usize] = next;
        }
    }

    fn change(&mut self, node: usize, by: i16) {
        self.remove(node);
        self.rank[node] = self.rank[node].saturating_add_signed(by);
        self.insert(node);
    }

    /// A node of the highest rank above zero.
    fn pop(&mut self) -> Option<usize> {
        while self.best > 0 {
            let node = self.first[self.best];
            if node != NONE {
                self.remove(node as usize);
                return Some(node as usize);
            }
            self.best -= 1;
        }
        None
    }
}

/// For each node its number among the coarse ones, or [`FINE`].
///
/// The first pass of Ruge and Stüben 1987: again and again the node on which most others depend becomes coarse, and these
/// others fine.
pub(super) fn split(graph: &Rows) -> Scratch<u32> {
    let n = graph.len();
    let limits = strong_limits(graph);
    let mut coarse_of = Scratch::filled(UNDECIDED, n);
    let nobody = || Scratch::filled(NONE, n);
    let mut ranking =
        Ranking { first: Vec::new(), next: nobody(), previous: nobody(), rank: Scratch::filled(0, n), best: 0 };
    for node in (0..n).rev() {
        let wanted = graph.pairs(node).filter(|&(other, weight)| weight >= limits[other]).count();
        ranking.rank[node] = wanted.min(1 << 14) as u16;
        ranking.insert(node);
    }
    while let Some(node) = ranking.pop() {
        coarse_of[node] = COARSE;
        for (other, weight) in graph.pairs(node) {
            if coarse_of[other] != UNDECIDED {
                continue;
            }
            if weight >= limits[other] {
                coarse_of[other] = FINE;
                ranking.remove(other);
                for (wanted, weight) in graph.pairs(other) {
                    if weight >= limits[other] && coarse_of[wanted] == UNDECIDED {
                        ranking.change(wanted, 1);
                    }
                }
            } else if weight >= limits[node] {
                ranking.change(other, -1);
            }
        }
    }
    let mut count = 0;
    for node in 0..n {
        if coarse_of[node] == UNDECIDED {
            let mut strong = graph.pairs(node).filter(|&(_, weight)| weight >= limits[node]);
            let fine = strong.any(|(other, _)| coarse_of[other] != FINE && coarse_of[other] != UNDECIDED)
                || graph.values(node).next().is_none();
            coarse_of[node] = if fine { FINE } else { COARSE };
        }
        if coarse_of[node] != FINE {
            coarse_of[node] = count;
            count += 1;
        }
    }
    coarse_of
}
