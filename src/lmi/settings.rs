//! Checks that the settings of all solvers share.

/// A setting is out of its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("setting {name} = {value} must lie strictly between 0 and {most}")]
pub struct SettingError {
    /// Name of the setting.
    pub name: &'static str,
    /// Value given.
    pub value: f64,
    /// Exclusive upper limit.
    pub most: f64,
}

/// Refuses tolerances and step fractions outside of (0, 1).
pub(super) fn check_settings(settings: &[(&'static str, f64)]) -> Result<(), SettingError> {
    for &(name, value) in settings {
        if !(value > 0.0 && value < 1.0) {
            return Err(SettingError { name, value, most: 1.0 });
        }
    }
    Ok(())
}
