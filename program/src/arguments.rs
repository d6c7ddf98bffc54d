//! The arguments of a program, and what is wrong with them.

use hybank_core::messages::usage;

/// The arguments of this program. What follows an option is its value, a negative one too, so the message
/// about it says what is wrong with it. After an option that takes a path it is the next option.
///
/// # Errors
/// What is wrong with the usage, or the help that was asked for.
pub fn arguments<A: clap::CommandFactory + clap::FromArgMatches>() -> Result<A, clap::Error> {
    let path = clap::value_parser!(std::path::PathBuf).type_id();
    let with_negative = |arg: clap::Arg| {
        let has_value = !arg.is_positional() && arg.get_action().takes_values();
        let is_path = arg.get_value_parser().type_id() == path;
        if has_value && !is_path { arg.allow_hyphen_values(true) } else { arg }
    };
    let command = A::command().mut_subcommands(|command| command.mut_args(with_negative));
    A::from_arg_matches(&command.try_get_matches()?)
}

/// What clap says of the usage of this program, with the arguments in it quoted.
pub(crate) fn quoted_usage(message: &clap::Error) -> String {
    let typed = std::env::args_os().map(|argument| argument.to_string_lossy().into_owned());
    usage(&message.to_string(), typed)
}
