//! Tests of `archive`.

use super::*;

#[test]
fn a_name_cannot_leave_the_folder() {
    let folder = Path::new("/lab/silver");
    assert_eq!(
        within(folder, "flakes/00_00.exr"),
        Some(folder.join("flakes/00_00.exr"))
    );
    for name in ["../blue/paint.json", "/etc/passwd", "flakes/../../x", ""] {
        assert_eq!(within(folder, name), None, "{name}");
    }
}

/// An archive of nothing that announces so many files.
fn announcing(count: u16, large: Option<u64>) -> Bytes {
    let mut bytes = Vec::new();
    if let Some(large) = large {
        bytes.extend(b"PK\x06\x06");
        bytes.extend([0; 28]);
        bytes.extend(large.to_le_bytes());
        bytes.extend([0; 16]);
        bytes.extend(b"PK\x06\x07\0\0\0\0");
        bytes.extend([0; 12]);
    }
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend(count.to_le_bytes());
    bytes.extend(count.to_le_bytes());
    bytes.extend([0; 10]);
    bytes.into()
}

#[test]
fn no_end_hides_a_larger_one() {
    // The small end announces five files and an offset that only the large one can tell.
    let mut offset = announcing(5, Some(50_000_000)).to_vec();
    let end = offset.len() - 22;
    offset[end + 16..end + 20].fill(0xff);
    // A comment looks like another end, whole or not.
    let mut comment = announcing(0xffff, Some(50_000_000)).to_vec();
    comment.extend_from_slice(b"PK\x05\x06");
    let mut whole = comment.clone();
    whole.extend_from_slice(&[0; 18]);
    for bytes in [offset, comment, whole] {
        let archive = Archive::in_memory(bytes.into(), &Limits::default());
        assert!(
            matches!(
                archive,
                Err(PackageError::Entries {
                    count: 50_000_000,
                    ..
                })
            ),
            "{archive:?}"
        );
    }
}

/// A whole archive of this many files without contents.
fn of_files(count: usize) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(io::Cursor::new(Vec::new()));
    for k in 0..count {
        let options = zip::write::SimpleFileOptions::default();
        zip.start_file(format!("{k:0>200}"), options)
            .expect("begins");
    }
    zip.finish().expect("ends").into_inner()
}

#[test]
fn no_more_of_a_directory_is_read_than_the_accepted_files_need() {
    let few = Limits {
        entries: 10,
        ..Limits::default()
    };
    // 1.2 MB of directory, the end of which lies where only the reader of archives still looks for it.
    let mut beyond = of_files(5000);
    beyond.extend(std::iter::repeat_n(0, 65_540));
    let told = Archive::in_memory(beyond.into(), &few).expect_err("too long");
    assert!(told.to_string().contains("longer than"), "{told}");
    assert!(Archive::in_memory(of_files(10).into(), &few).is_ok());
}

#[test]
fn files_are_counted_before_the_directory_is_read() {
    for (count, large, announced) in [
        (30_000, None, 30_000),
        (0xffff, None, 0xffff),
        (0xffff, Some(50_000_000), 50_000_000),
    ] {
        let archive = Archive::in_memory(announcing(count, large), &Limits::default());
        assert!(
            matches!(archive, Err(PackageError::Entries { count, .. }) if count == announced),
            "{announced}"
        );
    }
    let mut nothing = Cursor::new(Source::Memory(Bytes::from_static(b"PK"))).expect("opens");
    let announced = Directory::announced(&mut nothing, 2).expect("reads");
    assert_eq!(announced, Directory::default());
}

#[test]
fn a_name_that_stands_there_twice_is_told() {
    let mut zip = zip::ZipWriter::new(io::Cursor::new(Vec::new()));
    for name in ["a.exr", "slices/b.exr", "slices/c.exr"] {
        let options = zip::write::SimpleFileOptions::default();
        zip.start_file(name, options).expect("begins");
    }
    let mut bytes = zip.finish().expect("ends").into_inner();
    // Under another name in the file itself, as in the directory.
    while let Some(at) = bytes.windows(12).position(|w| w == b"slices/c.exr") {
        bytes[at + 7] = b'b';
    }
    let refused = Archive::in_memory(bytes.into(), &Limits::default());
    let told = refused.expect_err("two of one name").to_string();
    assert!(told.contains("one name, slices/b.exr"), "{told}");
}

#[cfg(unix)]
#[test]
fn neither_pipes_nor_links_out_of_the_folder_are_read() {
    let place = tempfile::tempdir().expect("a folder");
    let (folder, outside) = (place.path().join("lab"), place.path().join("secret"));
    std::fs::create_dir(&folder).expect("makes");
    std::fs::write(&outside, "secret").expect("writes");
    std::fs::write(folder.join("own"), "own").expect("writes");
    std::os::unix::fs::symlink(&outside, folder.join("out")).expect("links");
    std::os::unix::fs::symlink("own", folder.join("in")).expect("links");
    let made = std::process::Command::new("mkfifo")
        .arg(folder.join("pipe"))
        .status();
    assert!(made.expect("runs").success());
    let archive = Archive::at(&folder, &Limits::default()).expect("opens");
    let read = |name| {
        let (mut bytes, mut room) = (Vec::new(), Unpacking::default());
        let read = archive.read(name, 100, &mut bytes, &mut room);
        read.map(|()| bytes).map_err(|error| error.to_string())
    };
    assert_eq!(read("in"), Ok(b"own".to_vec()));
    for (name, what) in [("out", "leaves the folder"), ("pipe", "no regular file")] {
        let told = read(name).expect_err(name);
        assert!(told.contains(name) && told.contains(what), "{told}");
    }
}
