//! How long the stages of some work took, one after the other.

use std::time::{Duration, Instant};

/// A clock that is read at the end of each stage.
#[derive(Clone, Debug)]
pub struct Laps {
    since: Instant,
    ended: Vec<Lap>,
}

/// A stage and how long it took.
pub type Lap = (&'static str, Duration);

impl Laps {
    /// The first stage begins.
    #[must_use]
    pub fn begin() -> Self {
        Self {
            since: Instant::now(),
            ended: Vec::new(),
        }
    }

    /// A stage is over, the next begins.
    pub fn end(&mut self, stage: &'static str) {
        let now = Instant::now();
        self.ended.push((stage, now - self.since));
        self.since = now;
    }

    /// The stages of some work are over, and what came between them and now is the last one's.
    pub fn end_with(&mut self, stages: &[Lap]) {
        let now = Instant::now();
        let mut rest = now - self.since;
        for (_, time) in stages {
            rest = rest.saturating_sub(*time);
        }
        self.ended.extend_from_slice(stages);
        if let Some((_, last)) = self.ended.last_mut() {
            *last += rest;
        }
        self.since = now;
    }

    /// All stages that are over.
    #[must_use]
    pub fn into_stages(self) -> Vec<Lap> {
        self.ended
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_of_some_work_and_what_is_around_them_add_up_to_the_whole() {
        let begun = Instant::now();
        let mut laps = Laps::begin();
        laps.end("open");
        let mut work = Laps::begin();
        std::thread::sleep(Duration::from_millis(2));
        work.end("draw");
        work.end("encode");
        std::thread::sleep(Duration::from_millis(2));
        laps.end_with(&work.into_stages());
        let whole = begun.elapsed();
        let stages = laps.into_stages();
        let names: Vec<&str> = stages.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["open", "draw", "encode"]);
        assert!(stages[1].1 >= Duration::from_millis(2));
        assert!(stages[2].1 >= Duration::from_millis(2));
        assert!(stages.iter().map(|(_, time)| *time).sum::<Duration>() <= whole);
    }
}
