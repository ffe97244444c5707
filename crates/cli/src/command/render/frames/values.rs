//! The values of the options `--frames`, `--turntable` and `--shutter`.

/// Default number of frames per second of a turntable.
const TURNTABLE_RATE: f64 = 24.0;
/// Maximum number of frames of a turn.
const MOST_OF_TURN: f64 = 100_000.0;

/// The value of `--frames`: a half-open interval of time and a number of frames per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRange {
    /// Start in seconds; `None` for the start of the animation.
    pub start: Option<f64>,
    /// End in seconds; `None` for the end of the animation.
    pub end: Option<f64>,
    /// Frames per second.
    pub rate: f64,
}

/// The value of `--turntable`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turntable {
    /// Frames of a whole turn.
    pub count: u32,
    /// Frames per second of an animated picture.
    pub rate: f64,
}

/// Shows the value as the option says it.
impl std::fmt::Display for Turntable {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self { count, rate: TURNTABLE_RATE } => write!(f, "{count}"),
            Self { count, rate } => write!(f, "{count}@{rate}"),
        }
    }
}

/// Reads `0..2s@24`, `0.5..@30`, `@24`.
pub fn parse_frames(text: &str) -> Result<FrameRange, String> {
    let error = || {
        format!(
            "\"{text}\" is not a range of frames; write START..END@RATE in seconds, such as \
                0..2s@24"
        )
    };
    let (range, rate) = text.split_once('@').ok_or_else(error)?;
    let rate = possible_rate(rate.trim().parse().map_err(|_| error())?)?;
    let seconds = |text: &str| match text.trim().trim_end_matches('s') {
        "" => Ok(None),
        number => match number.parse::<f64>().map_err(|_| error())? {
            time if time.abs() <= 1e6 => Ok(Some(time)),
            _ => Err(format!("{number} seconds are too many: times are from -1e6 to 1e6")),
        },
    };
    let (start, end) = if range.trim().is_empty() {
        ("", "")
    } else {
        range.split_once("..").ok_or_else(error)?
    };
    let (start, end) = (seconds(start)?, seconds(end)?);
    let is_empty = matches!((start, end), (Some(a), Some(b)) if a >= b);
    if is_empty { Err(error()) } else { Ok(FrameRange { start, end, rate }) }
}

/// Reads `48` or `48@24`.
pub fn parse_turntable(text: &str) -> Result<Turntable, String> {
    let error =
        || format!("\"{text}\" is not a number of frames; write N or N@RATE, such as 48@24");
    let (count, rate) =
        text.split_once('@').map_or((text, None), |(count, rate)| (count, Some(rate)));
    let count: f64 = count.trim().parse().map_err(|_| error())?;
    if count.fract() != 0.0 || !(1.0..=MOST_OF_TURN).contains(&count) {
        return Err(format!("{count} frames: a turn has 1 to {MOST_OF_TURN}"));
    }
    let rate =
        possible_rate(rate.map_or(Ok(TURNTABLE_RATE), |r| r.trim().parse()).map_err(|_| error())?)?;
    Ok(Turntable { count: count as u32, rate })
}

fn possible_rate(rate: f64) -> Result<f64, String> {
    if (0.001..=1000.0).contains(&rate) {
        return Ok(rate);
    }
    Err(format!("{rate} frames per second are not possible: rates are from 0.001 to 1000"))
}

/// Reads `0..0.02`.
pub fn parse_shutter(text: &str) -> Result<[f64; 2], String> {
    let error =
        || format!("\"{text}\" is not when a shutter opens and closes; write seconds as 0..0.02");
    let (open, close) = text.split_once("..").ok_or_else(error)?;
    let seconds = |text: &str| {
        text.trim().trim_end_matches('s').parse().ok().filter(|t: &f64| t.abs() <= 1e6)
    };
    let (open, close) = (seconds(open).ok_or_else(error)?, seconds(close).ok_or_else(error)?);
    if open <= close { Ok([open, close]) } else { Err(error()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_turns_and_shutters_are_understood() {
        let range = |start, end, rate| Ok(FrameRange { start, end, rate });
        assert_eq!(parse_frames("0..2s@24"), range(Some(0.0), Some(2.0), 24.0));
        assert_eq!(parse_frames(" 0.5 .. @ 12.5"), range(Some(0.5), None, 12.5));
        assert_eq!(parse_frames("@30"), range(None, None, 30.0));
        for wrong in ["", "24", "2..1@24", "0..2@0", "0..x@24", "nan..1@24", "0..2@24fps"] {
            assert!(parse_frames(wrong).is_err(), "{wrong}");
        }
        assert_eq!(parse_turntable("48@25"), Ok(Turntable { count: 48, rate: 25.0 }));
        for text in ["48@25", "7"] {
            assert_eq!(parse_turntable(text).map(|turn| turn.to_string()).as_deref(), Ok(text));
        }
        assert!(parse_turntable("0").is_err() && parse_turntable("8@no").is_err());
        assert_eq!(parse_shutter("-0.01..0.01s"), Ok([-0.01, 0.01]));
        assert!(parse_shutter("0.1").is_err() && parse_shutter("1..0").is_err());
    }
}
