//! Time as an idle machine would take it.
//!
//! Linux keeps account of the processor time of every thread (`/proc/self/task/*/schedstat`, nanoseconds first). Summed
//! over all threads of the process and divided by those that the work is spread over, it is what the work takes when
//! nothing else runs. Elsewhere wall time stands in.

use std::time::Instant;

/// A running clock.
pub(super) struct Clock {
    wall: Instant,
    processor: Option<f64>,
}

impl Clock {
    pub fn start() -> Self {
        Self {
            processor: processor_seconds(),
            wall: Instant::now(),
        }
    }

    /// Seconds since the start, of work spread over so many threads.
    pub fn seconds(&self, threads: usize) -> f64 {
        let wall = self.wall.elapsed().as_secs_f64();
        match (self.processor, processor_seconds()) {
            // More than the wall's is none of this work's; nothing at all is an account that was not kept.
            (Some(before), Some(now)) if now > before => {
                ((now - before) / threads.max(1) as f64).min(wall)
            }
            _ => wall,
        }
    }
}

/// What the clock shows, for people.
pub(super) fn name() -> &'static str {
    if processor_seconds().is_some() {
        "processor time over the threads that the work is spread over"
    } else {
        "wall time"
    }
}

/// Processor time of all threads of this process, seconds.
fn processor_seconds() -> Option<f64> {
    // The account of a running thread is brought up to date when it gives way; those that wait have given theirs.
    std::thread::yield_now();
    let tasks = std::fs::read_dir("/proc/self/task").ok()?;
    let mut nanoseconds = 0_u64;
    for task in tasks.flatten() {
        // A thread may end between the listing and the reading.
        let Ok(account) = std::fs::read_to_string(task.path().join("schedstat")) else {
            continue;
        };
        nanoseconds += account.split(' ').next()?.parse::<u64>().ok()?;
    }
    Some(nanoseconds as f64 * 1e-9)
}
