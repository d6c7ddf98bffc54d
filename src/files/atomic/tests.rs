use super::*;

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn appears_only_when_committed() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out.wav");
    let mut file = AtomicFile::create(&target, false).unwrap();
    file.write_all(b"whole").unwrap();
    assert!(!target.exists());
    file.commit().unwrap();
    assert_eq!(fs::read(&target).unwrap(), b"whole");
    assert_eq!(names(folder.path()), ["out.wav"]);
}

#[test]
fn leaves_nothing_when_dropped() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = AtomicFile::create(&folder.path().join("out.wav"), false).unwrap();
    file.write_all(b"half").unwrap();
    drop(file);
    assert!(names(folder.path()).is_empty());
}

#[test]
fn replaces_only_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out.wav");
    fs::write(&target, "old").unwrap();
    let error = AtomicFile::create(&target, false).unwrap_err();
    assert!(matches!(error, FileError::Exists { .. }) && error.to_string().contains("another name"));
    assert_eq!(fs::read(&target).unwrap(), b"old");
    AtomicFile::create(&target, true).unwrap().commit().unwrap();
    assert_eq!(fs::read(&target).unwrap(), b"");
}

#[test]
fn what_came_in_between_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out.wav");
    // Two runs that began before either of them ended.
    let mut first = AtomicFile::create(&target, false).unwrap();
    let mut second = AtomicFile::create(&target, false).unwrap();
    first.write_all(b"first").unwrap();
    second.write_all(b"second").unwrap();
    first.commit().unwrap();
    assert!(matches!(second.commit().unwrap_err(), FileError::Exists { .. }));
    assert_eq!(fs::read(&target).unwrap(), b"first");
    assert_eq!(names(folder.path()), ["out.wav"]);
}

#[test]
fn hidden_names_of_others_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let stale = hidden::beside(&folder.path().join("out.wav"), std::process::id(), 0).unwrap();
    fs::write(&stale, "not ours").unwrap();
    let target = folder.path().join("out.wav");
    AtomicFile::create(&target, false).unwrap().commit().unwrap();
    drop(AtomicFile::create(&target, true).unwrap());
    assert_eq!(fs::read(&stale).unwrap(), b"not ours");
}

#[test]
fn a_name_as_long_as_the_system_allows_is_no_fault() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("x".repeat(250));
    AtomicFile::create(&target, false).unwrap().commit().unwrap();
    assert!(target.exists());
}

#[cfg(unix)]
#[test]
fn a_replaced_file_keeps_its_permissions_and_is_never_more_open() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out.wav");
    for mode in [0o600, 0o640, 0o444] {
        let _ = fs::remove_file(&target);
        fs::write(&target, "old").unwrap();
        fs::set_permissions(&target, fs::Permissions::from_mode(mode)).unwrap();
        let file = AtomicFile::create(&target, true).unwrap();
        assert_eq!(file.beside.metadata().unwrap().permissions().mode() & 0o777, mode);
        file.commit().unwrap();
        assert_eq!(target.metadata().unwrap().permissions().mode() & 0o777, mode);
    }
}

/// Only root can give files away.
#[cfg(unix)]
#[test]
fn a_replaced_file_keeps_its_owner_if_root_replaces_it() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out.wav");
    fs::write(&target, "old").unwrap();
    if chown(&target, Some(12_345), Some(23_456)).is_err() {
        return trials::skipped(&"the owner of replaced files: not root");
    }
    fs::set_permissions(&target, fs::Permissions::from_mode(0o4640)).unwrap();
    let file = AtomicFile::create(&target, true).unwrap();
    let access = |path: &Path| {
        let known = path.metadata().unwrap();
        (known.uid(), known.gid(), known.mode() & 0o7777)
    };
    assert_eq!(access(&file.beside), (12_345, 23_456, 0o4640));
    file.commit().unwrap();
    assert_eq!(access(&target), (12_345, 23_456, 0o4640));
}

/// Another program removes the unfinished file and puts a link, or a file, in its place.
#[cfg(unix)]
#[test]
fn an_unfinished_file_that_another_program_replaced_gets_no_name() {
    let folder = tempfile::tempdir().unwrap();
    let (target, precious) = (folder.path().join("out.wav"), folder.path().join("precious"));
    fs::write(&precious, "another's").unwrap();
    for replace in [false, true] {
        if replace {
            fs::write(&target, "old").unwrap();
        }
        let mut file = AtomicFile::create(&target, replace).unwrap();
        file.write_all(b"new").unwrap();
        let hidden = file.beside.clone();
        fs::remove_file(&hidden).unwrap();
        std::os::unix::fs::symlink(&precious, &hidden).unwrap();
        let error = file.commit().unwrap_err().to_string();
        assert!(
            error.contains("another program moved, removed or replaced") && error.contains(".part"),
            "{error}"
        );
        assert_eq!(fs::read(&target).ok(), replace.then(|| b"old".to_vec()));
        // What another program put there is not removed.
        assert!(hidden.symlink_metadata().unwrap().is_symlink());
        fs::remove_file(hidden).unwrap();
    }
    assert_eq!(fs::read(&precious).unwrap(), b"another's");
}

#[cfg(unix)]
#[test]
fn links_are_followed_or_refused_but_never_replaced() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("sub")).unwrap();
    fs::write(path("sub/real"), "old").unwrap();
    symlink("sub/real", path("link")).unwrap();
    symlink("link", path("second")).unwrap();
    symlink("none", path("dangling")).unwrap();
    symlink("circle", path("circle")).unwrap();
    assert!(matches!(AtomicFile::create(&path("second"), false), Err(FileError::Exists { .. })));
    let mut file = AtomicFile::create(&path("second"), true).unwrap();
    file.write_all(b"new").unwrap();
    file.commit().unwrap();
    assert_eq!(fs::read(path("sub/real")).unwrap(), b"new");
    for (name, part) in [("dangling", "link to nothing"), ("circle", "back to itself")] {
        let error = AtomicFile::create(&path(name), true).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
    for name in ["link", "second", "dangling", "circle"] {
        assert!(path(name).symlink_metadata().unwrap().is_symlink(), "{name}");
    }
    assert_eq!(names(&path("sub")), ["real"]);
}

#[cfg(target_os = "linux")]
#[test]
fn links_to_open_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let open = File::create(folder.path().join("open")).unwrap();
    let descriptor = format!("/proc/self/fd/{}", std::os::fd::AsRawFd::as_raw_fd(&open));
    std::os::unix::fs::symlink(&descriptor, folder.path().join("link")).unwrap();
    for path in [PathBuf::from(descriptor), folder.path().join("link")] {
        let error = AtomicFile::create(&path, true).unwrap_err().to_string();
        assert!(error.contains("open file") && error.contains("the name of a file"), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn devices_pipes_and_sockets_are_never_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("socket");
    let _listener = std::os::unix::net::UnixListener::bind(&target).unwrap();
    let error = AtomicFile::create(&target, true).unwrap_err().to_string();
    assert!(error.contains("socket") && error.contains("the name of a file"), "{error}");
    assert!(target.symlink_metadata().unwrap().file_type().is_socket());
    assert_eq!(names(folder.path()), ["socket"]);
}

#[test]
fn refuses_folders_and_missing_folders() {
    let folder = tempfile::tempdir().unwrap();
    assert!(AtomicFile::create(folder.path(), true).is_err());
    let error = AtomicFile::create(&folder.path().join("no/such/out.wav"), false).unwrap_err();
    assert!(error.to_string().contains("no/such/out.wav"));
}

#[test]
fn unfinished_files_can_be_removed_from_elsewhere() {
    // Not remove_unfinished itself: other tests of this process are writing.
    let folder = tempfile::tempdir().unwrap();
    let file = AtomicFile::create(&folder.path().join("out.wav"), false).unwrap();
    assert!(unfinished(|files| files.contains_key(&file.beside)));
    let beside = file.beside.clone();
    file.commit().unwrap();
    assert!(unfinished(|files| !files.contains_key(&beside)));
}

fn file(folder: &Path, name: &str, replace: bool) -> AtomicFile {
    let mut file = AtomicFile::create(&folder.join(name), replace).unwrap();
    file.write_all(b"new").unwrap();
    file
}

fn content(folder: &Path) -> Vec<(String, String)> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let pair = |entry: fs::DirEntry| {
        let text = fs::read_to_string(entry.path()).unwrap_or_else(|_| "folder".into());
        (entry.file_name().to_string_lossy().into_owned(), text)
    };
    let mut content: Vec<_> = entries.map(pair).collect();
    content.sort();
    content
}

fn pairs(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
    pairs.iter().map(|&(name, text)| (name.to_owned(), text.to_owned())).collect()
}

#[test]
fn all_appear() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("b"), "old").unwrap();
    commit_all(vec![file(folder.path(), "a", true), file(folder.path(), "b", true)]).unwrap();
    assert_eq!(content(folder.path()), pairs(&[("a", "new"), ("b", "new")]));
}

#[test]
fn none_appears_if_one_is_taken_meanwhile() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["a", "b", "c"].map(|name| file(folder.path(), name, false));
    fs::write(folder.path().join("c"), "another's").unwrap();
    assert!(matches!(commit_all(files.into()), Err(FileError::Exists { .. })));
    assert_eq!(content(folder.path()), pairs(&[("c", "another's")]));
}

#[cfg(target_os = "linux")]
#[test]
fn what_was_replaced_comes_back_if_one_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a"), "old").unwrap();
    let files = ["a", "b"].map(|name| file(folder.path(), name, true));
    // A folder is not replaced by a file.
    fs::create_dir(folder.path().join("b")).unwrap();
    fs::write(folder.path().join("b/inside"), "").unwrap();
    assert!(commit_all(files.into()).is_err());
    assert_eq!(content(folder.path()), pairs(&[("a", "old"), ("b", "folder")]));
}
