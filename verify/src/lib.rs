//! Proves how good a bank is, from its file alone.
//!
//! [`verify`] encloses the error system of a bank and checks the certificates that its file states.
//! [`analog`] makes state equations of written filters, in doubles for the designer and enclosed for the
//! proof; [`arithmetic`] has the numbers of 106 and 512 bits. Nothing here searches, optimises or knows how
//! a bank was designed.

#![forbid(unsafe_code)]

pub mod analog;
pub mod arithmetic;
pub mod verify;
