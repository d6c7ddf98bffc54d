//! Captures as MATLAB files (.mat) of versions 5 to 7.2.
//!
//! Source: MathWorks, *MAT-File Format*, level 5. The numeric arrays of a file are its captures: integers of
//! up to 32 bits and floats, real or complex, compressed or not. `x.mat:name` chooses a variable; otherwise
//! it is the only array. Of two axes the shorter one holds the channels, and the rows do if both are equal,
//! as in NumPy arrays. A number called `fs` gives the rate.

mod array;
mod element;
mod frames;
mod variable;

pub use array::{MatArray, mat_variable};
pub use frames::MatReader;

#[cfg(test)]
mod tests;
