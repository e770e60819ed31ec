//! The workbench: where requests and jobs compute, off the threads that talk to the network.
//!
//! Requests have as many places as there are processors, jobs half as many of their own, so that a long ingest does not
//! keep a slider waiting. What finds no place waits; when too many wait, the next is turned away.

use std::any::Any;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use tokio::sync::Semaphore;
use tokio::task::spawn_blocking;

use crate::service::http::Problem;

/// Places to compute at.
#[derive(Clone, Debug)]
pub struct Workbench {
    places: Arc<Semaphore>,
    in_all: usize,
    waiting: Arc<AtomicUsize>,
    most_waiting: usize,
}

/// Work that was called off, as a panic that no one reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CalledOff;

/// Takes one off the count of those who wait, also when they stop waiting.
struct Waiting<'a>(&'a AtomicUsize);

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

impl Workbench {
    /// So many places, and so many who may wait for one.
    #[must_use]
    pub fn new(places: usize, most_waiting: usize) -> Self {
        let in_all = places.max(1);
        Self {
            places: Arc::new(Semaphore::new(in_all)),
            in_all,
            waiting: Arc::default(),
            most_waiting,
        }
    }

    /// Computes at the next free place.
    ///
    /// # Errors
    ///
    /// [`Problem`] when too many wait already, or when the work panicked.
    pub async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Problem> {
        match self.at_a_place(work).await? {
            Ok(value) => Ok(value),
            Err(CalledOff) => Err(Problem::internal(
                "work was called off that nobody can call off",
            )),
        }
    }

    /// Computes at the next free place something long; the work may stop by [`call_off`].
    ///
    /// It has threads of its own, so that the system shares the processors: on common threads a blend would wait until
    /// every line of a picture was drawn. As many as there are processors for each place that is taken, at least two.
    ///
    /// # Errors
    ///
    /// As [`Workbench::run`].
    pub async fn run_or_call_off<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<Result<T, CalledOff>, Problem> {
        let bench = self.clone();
        self.at_a_place(move || {
            let taken = bench.in_all - bench.places.available_permits();
            let threads = (rayon::current_num_threads() / taken.max(1)).max(2);
            match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
                Ok(own) => own.install(work),
                // The system has no threads to give.
                Err(_) => work(),
            }
        })
        .await
    }

    async fn at_a_place<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<Result<T, CalledOff>, Problem> {
        let place = {
            let ahead = self.waiting.fetch_add(1, Ordering::SeqCst);
            let _waiting = Waiting(&self.waiting);
            if self.places.available_permits() == 0 && ahead >= self.most_waiting {
                return Err(Problem::overloaded());
            }
            Arc::clone(&self.places)
                .acquire_owned()
                .await
                .map_err(Problem::internal)?
        };
        let done = spawn_blocking(move || {
            let _place = place;
            work()
        });
        match done.await {
            Ok(value) => Ok(Ok(value)),
            Err(error) => match error.try_into_panic() {
                Ok(panic) if panic.is::<CalledOff>() => Ok(Err(CalledOff)),
                Ok(panic) => Err(Problem::internal(format!(
                    "work panicked: {}",
                    words(panic.as_ref())
                ))),
                Err(error) => Err(Problem::internal(error)),
            },
        }
    }
}

/// Leaves the work from within: unwinds to the workbench without a word on stderr.
pub fn call_off() -> ! {
    resume_unwind(Box::new(CalledOff))
}

fn words(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("?")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::http::Kind;
    use std::sync::mpsc;

    #[tokio::test]
    async fn who_finds_the_queue_full_is_turned_away() {
        let bench = Workbench::new(1, 1);
        let (open, closed) = mpsc::channel::<()>();
        let busy = tokio::spawn({
            let bench = bench.clone();
            async move { bench.run(move || closed.recv().is_err()).await }
        });
        while bench.places.available_permits() > 0 {
            tokio::task::yield_now().await;
        }
        let waits = tokio::spawn({
            let bench = bench.clone();
            async move { bench.run(|| 7).await }
        });
        while bench.waiting.load(Ordering::SeqCst) == 0 {
            tokio::task::yield_now().await;
        }
        assert_eq!(
            bench.run(|| 8).await.expect_err("the queue is full").kind(),
            Kind::Overloaded
        );
        drop(open);
        assert_eq!(waits.await.expect("runs"), Ok(7));
        assert_eq!(busy.await.expect("runs"), Ok(true));
        assert_eq!(bench.run(|| 9).await, Ok(9));
    }

    #[tokio::test]
    async fn a_panic_and_a_call_are_told_apart_and_the_place_is_free_again() {
        let bench = Workbench::new(1, 1);
        assert_eq!(
            bench.run(|| panic!("a bug, on purpose")).await,
            Err::<(), _>(Problem::internal(""))
        );
        assert_eq!(
            bench.run_or_call_off(|| call_off()).await,
            Ok(Err::<(), _>(CalledOff))
        );
        let through_threads = bench.run_or_call_off(|| rayon::join(|| call_off(), || 2));
        assert_eq!(through_threads.await, Ok(Err::<((), i32), _>(CalledOff)));
        assert_eq!(bench.run(|| 1).await, Ok(1));
    }
}
