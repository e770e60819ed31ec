//! Results worth keeping: in memory, on disk behind it, and computed once however many ask.
//!
//! A key is the hash of everything that makes the result. The disk outlives the process; its files carry the hash of
//! their bytes, so a torn one is noticed and made again. Nothing here is needed: losing all of it costs time only.

mod disk;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;
use futures::FutureExt;
use futures::future::{BoxFuture, Shared};
use moka::future::Cache;
use moka::policy::EvictionPolicy;
use tokio::sync::oneshot;
use tokio::task::spawn_blocking;

use self::disk::ResultFolder;
use super::StoreError;
use super::blobs::Hash;

/// Bookkeeping of one entry in memory, bytes, added to its size.
const ENTRY_OVERHEAD: usize = 256;

/// A result and the hash of its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CachedResult {
    /// The bytes.
    pub bytes: Bytes,
    /// Their hash.
    pub hash: Hash,
}

type Flight<E> = Shared<BoxFuture<'static, Result<CachedResult, E>>>;

/// A cache of results whose computation may fail with `E`.
#[derive(Clone, Debug)]
pub struct ResultCache<E> {
    memory: Cache<Hash, CachedResult>,
    disk: Arc<ResultFolder>,
    flights: Arc<Mutex<HashMap<Hash, Flight<E>>>>,
}

/// Takes a flight off the list however its task ends.
struct Landing<E> {
    flights: Arc<Mutex<HashMap<Hash, Flight<E>>>>,
    key: Hash,
}

impl<E> Drop for Landing<E> {
    fn drop(&mut self) {
        self.flights
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .remove(&self.key);
    }
}

impl<E: Clone + Send + Sync + 'static> ResultCache<E> {
    /// Opens the cache whose files lie in `folder`, with so many bytes in memory and on disk.
    ///
    /// # Errors
    ///
    /// [`StoreError::Io`] when the folder cannot be made or read.
    pub fn open(folder: &Path, memory_bytes: u64, disk_bytes: u64) -> Result<Self, StoreError> {
        let memory = Cache::builder()
            .weigher(|_, result: &CachedResult| {
                u32::try_from(result.bytes.len() + ENTRY_OVERHEAD).unwrap_or(u32::MAX)
            })
            .max_capacity(memory_bytes)
            .eviction_policy(EvictionPolicy::lru())
            .build();
        Ok(Self {
            memory,
            disk: Arc::new(ResultFolder::open(folder, disk_bytes)?),
            flights: Arc::default(),
        })
    }

    /// The result if it is in memory.
    pub async fn in_memory(&self, key: Hash) -> Option<CachedResult> {
        self.memory.get(&key).await
    }

    /// Whether the result is kept, as far as can be told without reading it.
    pub async fn holds(&self, key: Hash) -> bool {
        self.memory.contains_key(&key) || self.disk.holds(key).await
    }

    /// The result of this key, from memory, from disk, or computed, once for all who ask at the same time.
    ///
    /// A computation that has begun goes on when its callers leave. Errors are handed to all who wait and not kept.
    ///
    /// # Errors
    ///
    /// What the computation says.
    ///
    /// # Panics
    ///
    /// When the computation panicked.
    pub async fn get_or_compute<F>(
        &self,
        key: Hash,
        compute: impl FnOnce() -> F + Send + 'static,
    ) -> Result<CachedResult, E>
    where
        F: Future<Output = Result<Bytes, E>> + Send + 'static,
    {
        if let Some(result) = self.in_memory(key).await {
            return Ok(result);
        }
        let flight = {
            let mut flights = self.flights.lock().unwrap_or_else(PoisonError::into_inner);
            flights
                .entry(key)
                .or_insert_with(|| self.begin_flight(key, compute))
                .clone()
        };
        flight.await
    }

    fn begin_flight<F>(&self, key: Hash, compute: impl FnOnce() -> F + Send + 'static) -> Flight<E>
    where
        F: Future<Output = Result<Bytes, E>> + Send + 'static,
    {
        let (sender, receiver) = oneshot::channel();
        let landing = Landing {
            flights: Arc::clone(&self.flights),
            key,
        };
        let (memory, disk) = (self.memory.clone(), Arc::clone(&self.disk));
        tokio::spawn(async move {
            // Ends last: whoever comes before finds the flight, whoever comes after finds the result.
            let _landing = landing;
            // An earlier flight may have landed since the caller looked.
            let known = match memory.get(&key).await {
                Some(result) => Some(result),
                None => disk.read(key).await,
            };
            if let Some(result) = known {
                memory.insert(key, result.clone()).await;
                let _ = sender.send(Ok(result));
                return;
            }
            match compute().await {
                Ok(bytes) => {
                    // Hashing takes a millisecond or two a megabyte: not on a thread that others wait for.
                    let hashed = spawn_blocking(move || CachedResult {
                        hash: Hash::of(&bytes),
                        bytes,
                    });
                    let Ok(result) = hashed.await else { return };
                    memory.insert(key, result.clone()).await;
                    let _ = sender.send(Ok(result.clone()));
                    disk.write(key, result).await;
                }
                Err(error) => {
                    let _ = sender.send(Err(error));
                }
            }
        });
        async move {
            receiver
                .await
                .expect("the computation of a result panicked")
        }
        .boxed()
        .shared()
    }
}
