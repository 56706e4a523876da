//! Turning Embree's error codes into words.

/// Why an opened library is not usable.
#[derive(Debug)]
pub(crate) enum LoadFailure {
    /// It lacks a function.
    MissingSymbol(&'static str),
}

impl std::fmt::Display for LoadFailure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::MissingSymbol(name) => write!(f, "it has no function {name}"),
        }
    }
}

/// The name of an `RTCError`.
pub(crate) fn code_name(code: i32) -> String {
    match code {
        0 => "RTC_ERROR_NONE".to_owned(),
        1 => "RTC_ERROR_UNKNOWN".to_owned(),
        2 => "RTC_ERROR_INVALID_ARGUMENT".to_owned(),
        3 => "RTC_ERROR_INVALID_OPERATION".to_owned(),
        4 => "RTC_ERROR_OUT_OF_MEMORY".to_owned(),
        5 => "RTC_ERROR_UNSUPPORTED_CPU".to_owned(),
        6 => "RTC_ERROR_CANCELLED".to_owned(),
        other => format!("error {other}"),
    }
}
