//! The memory that this process may use.

use std::fs;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Estimates of memory are true within a quarter, so they are low by this factor at most.
const ESTIMATES_LOW_BY: f64 = 4.0 / 3.0;

/// Bytes that stay free for what is not counted: an allocation of a few bytes that fails ends the process.
const RESERVE: f64 = 4e6;

/// Bytes of small pieces of work that are compared with what is free at one time: what the system says of
/// its memory takes longer to read than a small image.
const TOGETHER: usize = 1 << 20;

/// Work of fewer bytes is small.
const SMALL: usize = TOGETHER / 8;

/// What was found free for the small pieces of work of this process.
static SMALL_PIECES: Grant = Grant(AtomicUsize::new(0));

/// Work that takes more memory than this process may use.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("about {} of memory, and this process may use {}", size(*.needed), size(*.available))]
pub struct MemoryShortage {
    /// Bytes that the work takes.
    pub needed: f64,
    /// Bytes that the process may use.
    pub available: f64,
}

fn size(bytes: f64) -> String {
    if bytes < 1e9 { format!("{:.0} MB", bytes / 1e6) } else { format!("{:.1} GB", bytes / 1e9) }
}

/// Refuses work that takes more bytes than this process may use; the system would end the process. Where
/// addresses are limited it is tried whether the system hands out so much in one piece. Small pieces
/// of work are checked a megabyte at a time.
///
/// # Errors
/// [`MemoryShortage`] with both numbers.
pub fn check_memory(needed: f64) -> Result<(), MemoryShortage> {
    SMALL_PIECES.check(needed, check_now)
}

fn check_now(needed: f64) -> Result<(), MemoryShortage> {
    let (wanted, free) = (ESTIMATES_LOW_BY * needed + RESERVE, available_memory().unwrap_or(f64::INFINITY));
    // Without a limit of addresses the system hands out what it has not.
    let is_told = physical().is_some() && address_space().is_none();
    let is_given = || is_told || Vec::<u8>::new().try_reserve_exact(wanted as usize).is_ok();
    if wanted <= free && is_given() {
        return Ok(());
    }
    Err(MemoryShortage { needed, available: (free.min(wanted) - RESERVE).max(0.0) / ESTIMATES_LOW_BY })
}

/// Addresses of the stack of a thread, and some for what it allocates.
const THREAD: f64 = 4e6;

/// Share of the free addresses that threads may take.
const FOR_THREADS: f64 = 0.25;

/// As many threads as asked for, by default one for each processor; fewer, and one at least, where addresses
/// are limited (`ulimit -v`).
pub fn affordable_threads(asked: Option<usize>) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let room = address_space().map_or(f64::INFINITY, |free| FOR_THREADS * free / THREAD);
    asked.unwrap_or_else(cores).min(room as usize).max(1)
}

/// Begins the program again with one heap for all threads, where addresses are limited (`ulimit -v`). A
/// program calls it before its `main`, with its standard streams as they were given.
///
/// Otherwise the C library reserves 64 MB of addresses for each thread, at any request of it that finds as
/// many free: also those that were counted for the work. A single heap makes what is free known, so that
/// more memory is never worse. The library reads its setting when the program is loaded.
pub fn share_heap() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        use std::{env, os::unix::process::CommandExt, process::Command};
        const HEAPS: &str = "MALLOC_ARENA_MAX";
        if address_space().is_none() || env::var_os(HEAPS).is_some() {
            return;
        }
        let mut words = env::args_os();
        let Ok(program) = env::current_exe() else { return };
        // The dynamic loader was called with the name of this program, which is not known here.
        if program.file_name().is_some_and(|name| name.to_string_lossy().starts_with("ld-")) {
            return;
        }
        // The file of a program that runs may have been removed.
        let is_removed = program.as_os_str().as_encoded_bytes().ends_with(b" (deleted)");
        let program = if is_removed { "/proc/self/exe".into() } else { program };
        if let Some(name) = words.next() {
            // Comes back only if the system refuses it; then the run goes on with several heaps.
            let _ = Command::new(program).arg0(name).args(words).env(HEAPS, "1").exec();
        }
    }
}

/// Bytes that were found free and are not used up.
struct Grant(AtomicUsize);

impl Grant {
    /// Checks work by `ask`; small pieces by what is left of the last grant, or by a new one.
    fn check(
        &self,
        needed: f64,
        ask: impl Fn(f64) -> Result<(), MemoryShortage>,
    ) -> Result<(), MemoryShortage> {
        if needed >= SMALL as f64 {
            return ask(needed);
        }
        let rest = |granted: usize| granted.checked_sub(needed.ceil() as usize);
        if self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, rest).is_ok() {
            return Ok(());
        }
        match ask(needed + TOGETHER as f64) {
            Ok(()) => self.0.store(TOGETHER, Ordering::Relaxed),
            Err(_) => ask(needed)?,
        }
        Ok(())
    }
}

/// Bytes of memory that are free on the machine, or fewer where the process is limited (`ulimit -v`, a
/// control group, addresses of 32 bits); `None` where the system does not say. A process that takes more is
/// ended by the system without a message: with overcommit, it grants memory that it does not have.
pub fn available_memory() -> Option<f64> {
    [physical(), control_group(), address_space(), addressable()].into_iter().flatten().reduce(f64::min)
}

/// MemAvailable of /proc/meminfo, in kB there: free, or free after caches are dropped.
fn physical() -> Option<f64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("MemAvailable:"))?;
    Some(1024.0 * number(line.split_whitespace().nth(1)?)?)
}

/// The limit of the control group (version 2) at the root of the file system, as containers see it.
fn control_group() -> Option<f64> {
    number(fs::read_to_string("/sys/fs/cgroup/memory.max").ok()?.trim())
}

/// What the soft limit of the address space leaves beside what is in use.
fn address_space() -> Option<f64> {
    let text = fs::read_to_string("/proc/self/limits").ok()?;
    let line = text.lines().find(|line| line.starts_with("Max address space"))?;
    let limit = number(line.split_whitespace().nth(3)?)?;
    Some((limit - used().unwrap_or(0.0)).max(0.0))
}

/// What addresses of 32 bits reach, as in WebAssembly.
fn addressable() -> Option<f64> {
    (usize::BITS <= 32).then_some(usize::MAX as f64)
}

/// The address space in use, in kB there.
fn used() -> Option<f64> {
    let text = fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find(|line| line.starts_with("VmSize:"))?;
    Some(1024.0 * number(line.split_whitespace().nth(1)?)?)
}

/// A positive number; "max" and "unlimited" are none.
fn number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|bytes| *bytes > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_this_machine_is_known_where_it_is_told() {
        if cfg!(target_os = "linux") {
            assert!(available_memory().is_some_and(|bytes| bytes > 1e8));
        }
    }

    #[test]
    fn little_is_there_and_no_machine_has_everything() {
        assert_eq!(check_memory(1e6), Ok(()));
        let shortage = check_memory(1e19).unwrap_err();
        assert!(shortage.available > 1e6 && shortage.available < 1e19, "{shortage:?}");
        let message = shortage.to_string();
        assert!(
            message.starts_with("about 10000000000.0 GB of memory, and this process may use"),
            "{message}"
        );
    }

    /// Small pieces ask seldom, for no less than they take; large ones and those that find little left ask
    /// each for themselves.
    #[test]
    fn small_pieces_are_checked_together() {
        let (grant, asked) = (Grant(AtomicUsize::new(0)), std::cell::RefCell::new(Vec::new()));
        let ask_within = |free: f64| {
            let asked = &asked;
            move |needed: f64| {
                asked.borrow_mut().push(needed);
                if needed <= free { Ok(()) } else { Err(MemoryShortage { needed, available: free }) }
            }
        };
        (0..1000).for_each(|_| assert_eq!(grant.check(1e4, ask_within(1e9)), Ok(())));
        let (times, total) = (asked.borrow().len(), asked.borrow().iter().sum::<f64>());
        assert!(times <= 11 && total >= 1e7, "{times} {total}");
        assert_eq!(grant.check(5e5, ask_within(1e9)), Ok(()));
        assert_eq!((asked.borrow().len(), asked.borrow().last()), (times + 1, Some(&5e5)));
        let shortage = (0..1000).find_map(|_| grant.check(1e4, ask_within(9e3)).err());
        assert_eq!(shortage, Some(MemoryShortage { needed: 1e4, available: 9e3 }));
        assert_eq!(grant.check(8e3, ask_within(9e3)), Ok(()));
    }
}
