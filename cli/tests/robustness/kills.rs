//! Runs that are killed at random times.

use crate::kill_campaign::campaign;
use crate::support::random::Random;
use crate::work::{desk, jobs, manual, recorder};
use trials::rounds;

#[test]
fn a_killed_run_leaves_old_or_whole_files_and_the_next_one_names_the_rest() {
    let desk = desk(100_000);
    let mut dice = Random(1200);
    for job in jobs(&desk).into_iter().chain([recorder(&desk), manual(&desk)]) {
        let seen = campaign(&job, rounds(8), &mut dice);
        println!("{}: {seen}", job.args.join(" "));
    }
}
