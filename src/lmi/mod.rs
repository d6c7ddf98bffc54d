//! Interior-point methods for linear matrix inequalities. Knows no filter bank.
