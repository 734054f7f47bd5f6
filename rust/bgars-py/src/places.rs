//! On which processors the threads of a pool run.
//!
//! The kernel of a virtual machine may take processors that rest for some that its host has lent to others. Threads that wake
//! up are put on one processor together then, and share it for a hundredth of a second: longer than most calls. So each is
//! kept to processors of its own, except while somebody else wants these too: a thread that waits for its turn on a
//! processor holds up the others at every step, and gives the turn away whenever it looks for work.

use std::sync::{Mutex, PoisonError};
use std::{fs, process};

use rustix::thread::{CpuSet, Pid, gettid, sched_getaffinity, sched_setaffinity};

/// Where the threads of a pool run.
#[derive(Default)]
pub struct Places(Mutex<State>);

#[derive(Default)]
struct State {
    threads: Vec<Thread>,
    /// Whose threads they are: a fork has none of them.
    process: Option<u32>,
    /// Among how many the processors are shared out; `None` while every thread runs wherever it may.
    shares: Option<usize>,
    /// How many of them the current call works on.
    count: usize,
    /// Whether the last look saw others that want the processors.
    seen_crowded: bool,
}

struct Thread {
    id: Pid,
    /// Its number in the pool.
    index: usize,
    /// While it is kept to a share of the processors: that share, and those that it may run on otherwise.
    kept: Option<[CpuSet; 2]>,
}

impl Places {
    /// To be called once by each thread of the pool, with its number.
    pub fn enter(&self, index: usize) {
        self.with(|state| {
            let mut thread = Thread { id: gettid(), index, kept: None };
            state.process = Some(process::id());
            if let Some(shares) = state.shares {
                thread.keep(shares);
            }
            state.threads.push(thread);
        });
    }

    /// Begins a call on `count` threads, and keeps each to its share of the processors if nobody else wants these.
    pub fn begin(&self, count: usize) {
        self.with(|state| {
            state.count = count;
            // Whoever called may not have had the time yet to lie down: that others run says nothing now.
            if state.shares != Some(count) && state.has_room() {
                state.place(Some(count));
            }
        });
    }

    /// Keeps the threads to their shares if nobody else wants the processors, and lets them run wherever they may if others go
    /// on wanting these; to be called now and then while they work.
    pub fn look(&self) {
        self.with(|state| {
            let crowded = !state.has_room();
            if !crowded {
                state.place(Some(state.count));
            } else if state.seen_crowded {
                state.place(None);
            }
            state.seen_crowded = crowded;
        });
    }

    /// Lets the threads run wherever they may.
    pub fn free(&self) {
        self.with(|state| state.place(None));
    }

    fn with<T>(&self, act: impl FnOnce(&mut State) -> T) -> T {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl State {
    /// Whether there is a processor for each thread beside what others have running; not to know is to be careful.
    fn has_room(&self) -> bool {
        let processors = allowed().count() as usize;
        (2..=processors).contains(&self.count)
            && running().is_some_and(|running| {
                // Neither the calling thread, that runs to look, nor those of the pool are others.
                let others = running.saturating_sub(1);
                let room = processors - self.count;
                others <= room || others <= room + self.threads.iter().filter(|thread| thread.runs()).count()
            })
    }

    fn place(&mut self, shares: Option<usize>) {
        if self.shares == shares || self.process.is_some_and(|owner| owner != process::id()) {
            return;
        }
        self.shares = shares;
        if let Some(shares) = shares {
            self.threads.iter_mut().for_each(|thread| thread.keep(shares));
            return;
        }
        // Where somebody else has placed one of them meanwhile, that holds for all.
        let all_kept = self.threads.iter().all(Thread::is_where_kept);
        for thread in &mut self.threads {
            if let Some([_, allowed]) = thread.kept.take()
                && all_kept
            {
                let _ = sched_setaffinity(Some(thread.id), &allowed);
            }
        }
    }
}

impl Thread {
    /// Keeps it to its share of so many; where the system refuses, it stays as it is.
    fn keep(&mut self, shares: usize) {
        if let Ok(allowed) = sched_getaffinity(Some(self.id)) {
            let share = share(&allowed, self.index, shares);
            self.kept = sched_setaffinity(Some(self.id), &share).is_ok().then_some([share, allowed]);
        }
    }

    /// Whether it runs, or wants to.
    fn runs(&self) -> bool {
        // "11206 (name) R 1 ...", and a name may hold brackets.
        fs::read_to_string(format!("/proc/self/task/{}/stat", self.id))
            .is_ok_and(|line| line.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with('R')))
    }

    fn is_where_kept(&self) -> bool {
        self.kept.is_none_or(|[share, _]| sched_getaffinity(Some(self.id)).is_ok_and(|now| now == share))
    }
}

/// Share `index` of so many: every so manieth of the processors.
fn share(allowed: &CpuSet, index: usize, shares: usize) -> CpuSet {
    let processors: Vec<usize> = numbers(allowed).collect();
    let shares = shares.min(processors.len()).max(1);
    let mut share = CpuSet::new();
    for &processor in processors.iter().skip(index % shares).step_by(shares) {
        share.set(processor);
    }
    share
}

/// How many threads of the machine run or want to; `None` where the system does not say.
fn running() -> Option<usize> {
    // The fourth word of "0.20 0.18 0.12 1/80 11206".
    let load = fs::read_to_string("/proc/loadavg").ok()?;
    load.split(' ').nth(3)?.split('/').next()?.parse().ok()
}

/// The processors that this thread may run on.
fn allowed() -> CpuSet {
    sched_getaffinity(None).unwrap_or_default()
}

fn numbers(processors: &CpuSet) -> impl Iterator<Item = usize> {
    (0..CpuSet::MAX_CPU).filter(|&processor| processors.is_set(processor))
}
