//! COLMAP text models.
