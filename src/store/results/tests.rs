use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use super::*;

fn key(n: u8) -> Hash {
    Hash::of(&[n])
}

fn open(folder: &Path) -> ResultCache<String> {
    ResultCache::open(folder, 1 << 20, 1 << 20).expect("opens")
}

async fn must_be_known(cache: &ResultCache<String>, key: Hash) -> CachedResult {
    cache
        .get_or_compute(key, || async { panic!("is known") })
        .await
        .expect("no error")
}

#[tokio::test]
async fn sixteen_who_ask_at_once_cost_one_computation() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (cache, count) = (open(folder.path()), Arc::new(AtomicU32::new(0)));
    let ask = |_| {
        let (cache, count) = (cache.clone(), Arc::clone(&count));
        async move {
            let compute = move || async move {
                count.fetch_add(1, Ordering::SeqCst);
                tokio::time::sleep(Duration::from_millis(20)).await;
                Ok(Bytes::from_static(b"silver"))
            };
            cache
                .get_or_compute(key(1), compute)
                .await
                .expect("no error")
                .bytes
        }
    };
    let all = futures::future::join_all((0..16).map(ask)).await;
    assert!(all.iter().all(|bytes| &bytes[..] == b"silver"));
    assert_eq!(count.load(Ordering::SeqCst), 1);
}

#[tokio::test]
async fn what_is_held_is_told_from_memory_and_from_disk() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let cache = open(folder.path());
    assert!(!cache.holds(key(1)).await);
    let blue = || async { Ok(Bytes::from_static(b"blue")) };
    cache.get_or_compute(key(1), blue).await.expect("no error");
    assert!(cache.holds(key(1)).await && !cache.holds(key(2)).await);
    let in_time = async {
        while !cache.disk.holds(key(1)).await {
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    };
    let written = tokio::time::timeout(Duration::from_secs(10), in_time);
    written.await.expect("is written");
    let reopened = open(folder.path());
    assert!(reopened.in_memory(key(1)).await.is_none());
    assert!(reopened.holds(key(1)).await && !reopened.holds(key(2)).await);
}

#[tokio::test]
async fn a_computation_goes_on_when_its_caller_leaves() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let cache = open(folder.path());
    let slow = || async {
        tokio::time::sleep(Duration::from_millis(50)).await;
        Ok(Bytes::from_static(b"blue"))
    };
    assert!(
        tokio::time::timeout(Duration::from_millis(5), cache.get_or_compute(key(1), slow))
            .await
            .is_err()
    );
    assert_eq!(must_be_known(&cache, key(1)).await.bytes, "blue");
}

#[tokio::test]
async fn an_error_reaches_all_who_wait_and_is_not_kept() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let cache = open(folder.path());
    let fail = || async { Err("no".to_owned()) };
    let (a, b) = tokio::join!(
        cache.get_or_compute(key(1), fail),
        cache.get_or_compute(key(1), fail)
    );
    assert_eq!((a, b), (Err("no".to_owned()), Err("no".to_owned())));
    let result = cache
        .get_or_compute(key(1), || async { Ok(Bytes::from_static(b"yes")) })
        .await;
    assert_eq!(result.expect("computed").bytes, "yes");
}

/// A result reaches the disk a moment after its caller.
async fn kept(folder: &Path) -> PathBufs {
    for _ in 0..500 {
        let files = files(folder);
        let incoming = folder.join(disk::INCOMING);
        if !files.is_empty() && files.iter().all(|path| path.parent() != Some(&incoming)) {
            return files;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    panic!("no result was kept");
}

type PathBufs = Vec<std::path::PathBuf>;

fn files(folder: &Path) -> PathBufs {
    let mut all = Vec::new();
    for item in std::fs::read_dir(folder).expect("a folder") {
        let path = item.expect("an entry").path();
        if path.is_dir() {
            all.extend(files(&path));
        } else {
            all.push(path);
        }
    }
    all
}

#[tokio::test]
async fn the_disk_remembers_and_a_torn_file_is_made_again() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let bytes = Bytes::from(vec![7; 5000]);
    let made = bytes.clone();
    let first = open(folder.path())
        .get_or_compute(key(1), || async { Ok(made) })
        .await
        .expect("computed");
    let file = kept(folder.path()).await.remove(0);
    assert_eq!(must_be_known(&open(folder.path()), key(1)).await, first);

    for torn in [&[][..], &bytes[..20], &bytes[..3000]] {
        std::fs::write(&file, torn).expect("tears the file");
        let again = bytes.clone();
        let result = open(folder.path())
            .get_or_compute(key(1), || async { Ok(again) })
            .await;
        assert_eq!(result.expect("computed again"), first);
        kept(folder.path()).await;
    }
}

#[tokio::test]
async fn the_disk_keeps_to_its_space() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let cache = ResultCache::<String>::open(folder.path(), 0, 100_000).expect("opens");
    for n in 0..40 {
        cache
            .get_or_compute(
                key(n),
                move || async move { Ok(Bytes::from(vec![n; 10_000])) },
            )
            .await
            .expect("computed");
    }
    cache
        .get_or_compute(key(99), || async { Ok(Bytes::from(vec![0; 90_000])) })
        .await
        .expect("too large, not kept");
    // Results reach the disk a moment after their callers: wait until the folder rests.
    let mut seen = Vec::new();
    for _ in 0..100 {
        tokio::time::sleep(Duration::from_millis(100)).await;
        let lengths = files(folder.path());
        let lengths = lengths.iter().filter_map(|path| path.metadata().ok());
        seen.push(lengths.map(|file| file.len()).sum::<u64>());
        if let [.., before, now] = seen[..]
            && seen.len() > 3
            && before == now
        {
            break;
        }
    }
    let held = *seen.last().expect("was looked at");
    assert!((10_000..=100_000).contains(&held), "{seen:?}");
}
