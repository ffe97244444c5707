//! Values of settings as users write them, and their conversion to fields of a
//! [`Request`](super::Request).

use super::setting::{Form, Problem, in_words};
use super::{Denoise, GuidingPasses};
use crate::film::filter::Filter;
use crate::integrator::IntegratorKind;
use crate::integrator::aov::Aov;
use crate::light_sampler::LightSamplerKind;
use crate::sampler::SamplerKind;
use crate::settings::{CausticsMode, Crop, LightStrategy, Shadows, Terminator};
use snell_intersect::{AcceleratorKind, Quality};
use snell_math::ColorModel;
use snell_math::parameters::Range;
use snell_scene::overrides::nearest;
use std::path::PathBuf;
use std::time::Duration;

/// A value as a user writes it: a text on a command line, or a value in Python or in a message.
#[derive(Clone, Debug, PartialEq)]
pub enum Wish {
    /// True or false. On a command line, an option without a value is true.
    Flag(bool),
    /// A whole number.
    Whole(i64),
    /// A number that need not be whole.
    Number(f64),
    /// A text, which may stand for a value of any other form.
    Text(String),
    /// A file or folder.
    Path(PathBuf),
    /// A list of values.
    List(Vec<Self>),
    /// Values with names.
    Named(Vec<(String, Self)>),
}

/// The number that a wish of any form stands for, if it is one.
fn number(wish: &Wish) -> Option<f64> {
    match wish {
        Wish::Whole(n) => Some(*n as f64),
        Wish::Number(x) => Some(*x),
        Wish::Text(text) => text.trim().parse().ok(),
        _ => None,
    }
}

/// The whole numbers of a list, or of a text in which one of these characters separates them.
fn wholes(wish: &Wish, separators: &[char]) -> Option<Vec<i64>> {
    let whole = |wish: &Wish| match wish {
        Wish::Whole(n) => Some(*n),
        Wish::Text(text) => text.trim().parse().ok(),
        _ => None,
    };
    match wish {
        Wish::List(items) => items.iter().map(whole).collect(),
        Wish::Text(text) => text.split(separators).map(|n| n.trim().parse().ok()).collect(),
        _ => None,
    }
}

/// The texts of a list, or of a text in which commas separate them.
fn texts(wish: &Wish) -> Option<Vec<String>> {
    let text = |wish: &Wish| match wish {
        Wish::Text(text) => Some(text.clone()),
        Wish::Whole(n) => Some(n.to_string()),
        _ => None,
    };
    match wish {
        Wish::List(items) => items.iter().map(text).collect(),
        Wish::Text(text) => Some(text.split(',').map(|item| item.trim().to_string()).collect()),
        Wish::Whole(n) => Some(vec![n.to_string()]),
        _ => None,
    }
}

/// The error for a value of the wrong type.
fn unlike<T>(expected: impl Into<String>) -> Result<T, Problem> {
    Err(Problem::Kind(format!("expected {}", expected.into())))
}

/// A type that the value of a setting can have.
pub(super) trait Wished: Sized {
    /// How values of the type are written on a command line.
    const FORM: Form = Form::Value;

    /// Reads a value. `None` stands for the default, to which some settings can be set back.
    fn read(wish: &Wish, range: Range) -> Result<Option<Self>, Problem>;

    /// What is wrong with the value, if anything: the wrong number, and what is expected instead.
    fn problem(&self, _range: Range) -> Option<[String; 2]> {
        None
    }

    /// The value as it is written on a command line; empty if the option alone says it.
    fn text(&self) -> String {
        String::new()
    }

    /// The values of the option on a command line, which may be given several times; none if it is
    /// left out.
    fn texts(&self) -> Vec<String> {
        vec![self.text()]
    }

    /// The names to choose from; empty if the type is not a choice.
    fn choices() -> Vec<&'static str> {
        Vec::new()
    }

    /// The name of the default choice; empty if the type is not a choice.
    fn default_name() -> &'static str {
        ""
    }
}

impl Wished for bool {
    const FORM: Form = Form::Flag;

    fn read(wish: &Wish, _: Range) -> Result<Option<Self>, Problem> {
        match wish {
            Wish::Flag(flag) => Ok(Some(*flag)),
            _ => unlike("True or False"),
        }
    }

    fn texts(&self) -> Vec<String> {
        if *self { vec![String::new()] } else { Vec::new() }
    }
}

impl Wished for u32 {
    fn read(wish: &Wish, range: Range) -> Result<Option<Self>, Problem> {
        let expected = in_words(range, true);
        match wish {
            Wish::Whole(n) => match Self::try_from(*n) {
                Ok(n) => Ok(Some(n)),
                Err(_) => Err(Problem::Value(format!("expected {expected}"))),
            },
            Wish::Text(text) => match text.trim().parse() {
                Ok(n) => Ok(Some(n)),
                Err(_) => unlike(expected),
            },
            _ => unlike(expected),
        }
    }

    fn text(&self) -> String {
        self.to_string()
    }

    fn problem(&self, range: Range) -> Option<[String; 2]> {
        let is_possible = range.contains(f64::from(*self));
        (!is_possible).then(|| [self.to_string(), in_words(range, true)])
    }
}

macro_rules! numbers {
    ($($type:ty,)*) => {$(
        impl Wished for $type {
            fn read(wish: &Wish, range: Range) -> Result<Option<Self>, Problem> {
                match number(wish) {
                    Some(x) => Ok(Some(x as $type)),
                    None => unlike(in_words(range, false)),
                }
            }

            fn text(&self) -> String {
                self.to_string()
            }

            fn problem(&self, range: Range) -> Option<[String; 2]> {
                let is_possible = range.contains(f64::from(*self)) && !self.is_nan();
                (!is_possible).then(|| [self.to_string(), in_words(range, false)])
            }
        }
    )*};
}
numbers! { f32, f64, }

impl Wished for Duration {
    fn read(wish: &Wish, range: Range) -> Result<Option<Self>, Problem> {
        const EXPECTED: &str = "seconds, or a duration such as 30s, 5m, 1h or 1h30m";
        let seconds = match wish {
            Wish::Text(text) => seconds_of(text),
            wish => number(wish),
        };
        match seconds {
            None => unlike(EXPECTED),
            Some(seconds) if range.contains(seconds) => Ok(Some(Self::from_secs_f64(seconds))),
            Some(_) => {
                Err(Problem::Value("expected a positive number of seconds up to 1e9".into()))
            }
        }
    }

    fn text(&self) -> String {
        self.as_secs_f64().to_string()
    }
}

/// The number of seconds in a text such as `90`, `30s`, `5m` or `1h30m`.
pub fn seconds_of(text: &str) -> Option<f64> {
    if let Ok(seconds) = text.trim().parse() {
        return Some(seconds);
    }
    let (mut seconds, mut number) = (0.0, String::new());
    for c in text.trim().chars() {
        let unit = match c {
            's' => 1.0,
            'm' => 60.0,
            'h' => 3600.0,
            _ => {
                number.push(c);
                continue;
            }
        };
        seconds += std::mem::take(&mut number).parse::<f64>().ok()? * unit;
    }
    number.is_empty().then_some(seconds).filter(|_| !text.is_empty())
}

impl Wished for [u32; 2] {
    fn read(wish: &Wish, range: Range) -> Result<Option<Self>, Problem> {
        let high = range.ends().map_or(0.0, |[_, high]| high);
        let expected = format!("width and height, such as 1280x720, each from 1 to {high}");
        let Some(sides) = wholes(wish, &['x', 'X']) else { return unlike(expected) };
        let Ok([w, h]) = <[i64; 2]>::try_from(sides) else { return unlike(expected) };
        let side = |n: i64| u32::try_from(n).ok().filter(|&n| range.contains(f64::from(n)));
        match (side(w), side(h)) {
            (Some(w), Some(h)) => Ok(Some([w, h])),
            _ => Err(Problem::Value(format!("expected {expected}"))),
        }
    }

    fn text(&self) -> String {
        self.map(|side| side.to_string()).join("x")
    }

    fn problem(&self, range: Range) -> Option<[String; 2]> {
        let [low, high] = range.ends()?;
        let wrong = self.iter().find(|&&side| !range.contains(f64::from(side)))?;
        Some([wrong.to_string(), format!("sides from {low} to {high}")])
    }
}

impl Wished for Crop {
    fn read(wish: &Wish, _: Range) -> Result<Option<Self>, Problem> {
        const EXPECTED: &str = "x0,y0,x1,y1 in pixels with x0 < x1 and y0 < y1";
        let Some(borders) = wholes(wish, &[',']) else { return unlike(EXPECTED) };
        let Ok(borders) = <[i64; 4]>::try_from(borders) else { return unlike(EXPECTED) };
        match borders.map(|border| u32::try_from(border).ok()) {
            [Some(x0), Some(y0), Some(x1), Some(y1)] if x0 < x1 && y0 < y1 => {
                Ok(Some(Self { min: [x0, y0], max: [x1, y1] }))
            }
            _ => Err(Problem::Value(format!("expected {EXPECTED}"))),
        }
    }

    fn text(&self) -> String {
        [self.min, self.max].concat().iter().map(u32::to_string).collect::<Vec<_>>().join(",")
    }
}

macro_rules! choices {
    ($($type:ty,)*) => {$(
        impl Wished for $type {
            fn read(wish: &Wish, _: Range) -> Result<Option<Self>, Problem> {
                let Wish::Text(name) = wish else { return unlike("a name") };
                let found = Self::ALL.into_iter().find(|choice| choice.name() == name);
                found.map(Some).ok_or_else(|| unknown(name, &Self::choices()))
            }

            fn text(&self) -> String {
                self.name().into()
            }

            fn choices() -> Vec<&'static str> {
                Self::ALL.map(Self::name).to_vec()
            }

            fn default_name() -> &'static str {
                Self::default().name()
            }
        }
    )*};
}
choices! {
    AcceleratorKind, CausticsMode, ColorModel, Filter, IntegratorKind, LightSamplerKind,
    LightStrategy, Quality, SamplerKind, Shadows, Terminator,
}

/// The problem of a name that is none of the valid ones.
fn unknown(name: &str, known: &[&'static str]) -> Problem {
    let hint = nearest(name, known).map(|name| format!("; did you mean {name}?"));
    let (known, hint) = (known.join(", "), hint.unwrap_or_default());
    Problem::Value(format!("expected one of {known}{hint}"))
}

impl Wished for GuidingPasses {
    const FORM: Form = Form::OptionalValue;

    fn read(wish: &Wish, range: Range) -> Result<Option<Self>, Problem> {
        match wish {
            Wish::Flag(false) => Ok(None),
            Wish::Flag(true) => Ok(Some(Self::Auto)),
            Wish::Text(text) if text == "auto" => Ok(Some(Self::Auto)),
            wish => match u32::read(wish, range) {
                Ok(passes) => Ok(passes.map(Self::Count)),
                Err(Problem::Value(text)) => Err(Problem::Value(text)),
                Err(_) if matches!(wish, Wish::Text(_)) => {
                    unlike(format!("auto, or {}", in_words(range, true)))
                }
                Err(_) => unlike(format!("True, False or {}", in_words(range, true))),
            },
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Auto => "auto".into(),
            Self::Count(passes) => passes.text(),
        }
    }

    fn problem(&self, range: Range) -> Option<[String; 2]> {
        match self {
            Self::Auto => None,
            Self::Count(passes) => passes.problem(range),
        }
    }
}

impl Wished for Denoise {
    const FORM: Form = Form::OptionalValue;

    fn read(wish: &Wish, _: Range) -> Result<Option<Self>, Problem> {
        match wish {
            Wish::Flag(false) => Ok(None),
            Wish::Flag(true) => Ok(Some(Self::Found)),
            Wish::Text(text) if text.is_empty() => Ok(Some(Self::Found)),
            Wish::Text(text) => Ok(Some(Self::At(text.into()))),
            Wish::Path(path) if path.as_os_str().is_empty() => Ok(Some(Self::Found)),
            Wish::Path(path) => Ok(Some(Self::At(path.clone()))),
            _ => unlike("True, False or a path"),
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Found => String::new(),
            Self::At(path) => path.display().to_string(),
        }
    }
}

impl Wished for PathBuf {
    const FORM: Form = Form::Path;

    fn read(wish: &Wish, _: Range) -> Result<Option<Self>, Problem> {
        match wish {
            Wish::Path(path) => Ok(Some(path.clone())),
            Wish::Text(text) if !text.is_empty() => Ok(Some(text.into())),
            _ => unlike("a folder"),
        }
    }

    fn text(&self) -> String {
        self.display().to_string()
    }
}

impl Wished for Vec<Aov> {
    const FORM: Form = Form::List;

    fn read(wish: &Wish, _: Range) -> Result<Option<Self>, Problem> {
        let Some(names) = texts(wish).filter(|_| !matches!(wish, Wish::Whole(_))) else {
            return unlike("names of layers, such as depth and normal, or `all`");
        };
        let mut aovs = Self::new();
        for name in names.iter().map(|name| name.trim()).filter(|name| !name.is_empty()) {
            match Aov::ALL.into_iter().find(|aov| aov.name() == name) {
                Some(aov) => aovs.push(aov),
                None if name == "all" => aovs.extend(Aov::ALL),
                None => return Err(unknown(name, &Self::choices())),
            }
        }
        if aovs.is_empty() && !names.is_empty() {
            return unlike("names of layers, such as depth,normal, or `all`");
        }
        Ok(Some(aovs))
    }

    fn text(&self) -> String {
        self.iter().map(|aov| aov.name()).collect::<Vec<_>>().join(",")
    }

    fn choices() -> Vec<&'static str> {
        Aov::ALL.map(Aov::name).to_vec()
    }
}

impl Wished for Vec<(String, Vec<String>)> {
    const FORM: Form = Form::Lists;

    fn read(wish: &Wish, _: Range) -> Result<Option<Self>, Problem> {
        let expected = match wish {
            Wish::Text(_) => "NAME=LIST, such as key=0,lamp",
            _ => "a dictionary of lists of lights",
        };
        let of_text = |wish: &Wish| {
            let Wish::Text(text) = wish else { return None };
            let parts = text.split_once('=');
            let (name, list) = parts.filter(|(name, list)| !name.is_empty() && !list.is_empty())?;
            Some((name.to_string(), texts(&Wish::Text(list.into()))?))
        };
        let groups: Option<Self> = match wish {
            Wish::List(items) => items.iter().map(of_text).collect(),
            Wish::Named(items) => {
                items.iter().map(|(name, list)| Some((name.clone(), texts(list)?))).collect()
            }
            wish => of_text(wish).map(|group| vec![group]),
        };
        groups.map_or_else(|| unlike(expected), |groups| Ok(Some(groups)))
    }

    fn texts(&self) -> Vec<String> {
        self.iter().map(|(name, lights)| format!("{name}={}", lights.join(","))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Request;
    use super::*;
    use std::collections::BTreeMap;

    fn set(name: &str, wish: &Wish) -> Result<Request, Problem> {
        let setting = Request::setting(name).expect("there is such a setting");
        let mut request = Request::default();
        setting.set(&mut request, wish).map(|()| request)
    }

    fn text(name: &str, text: &str) -> Result<Request, Problem> {
        set(name, &Wish::Text(text.into()))
    }

    #[test]
    fn the_arguments_of_a_request_make_the_same_one() {
        let given = [
            "--integrator=direct",
            "--spp=16",
            "--size=64x48",
            "--time=90.5",
            "--crop=1,2,30,40",
            "--guiding=3",
            "--clamp=0.1",
            "--bvh-compact",
            "--aov=depth,normal",
            "--light-group=key=0,lamp",
            "--light-group=sky=environment",
            "--denoise",
            "--exposure=-0.25",
        ];
        let mut request = Request::default();
        let mut lists: BTreeMap<&str, Vec<Wish>> = BTreeMap::new();
        for argument in given {
            let (option, value) = argument[2..].split_once('=').unwrap_or((&argument[2..], ""));
            let setting = Request::SETTINGS.iter().find(|s| s.option() == option);
            let setting = setting.expect("there is such an option");
            let wish = match setting.form {
                Form::Flag => Wish::Flag(true),
                Form::Lists => {
                    let list = lists.entry(setting.name).or_default();
                    list.push(Wish::Text(value.into()));
                    Wish::List(list.clone())
                }
                _ => Wish::Text(value.into()),
            };
            setting.set(&mut request, &wish).expect("a possible value");
        }
        assert_eq!(request.arguments(), given);
    }

    #[test]
    fn durations_are_understood() {
        let of = |duration: &str| text("time", duration).map(|request| request.time);
        assert_eq!(of("1h30m"), Ok(Some(Duration::from_secs(5400))));
        assert_eq!(of("2.5"), Ok(Some(Duration::from_millis(2500))));
        assert_eq!(of("30s"), Ok(Some(Duration::from_secs(30))));
        for wrong in ["5x", "", "0s", "-1", "1h30", "inf", "nan", "s", "1e10"] {
            assert!(of(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn values_have_the_same_meaning_as_text_and_as_values() {
        let pair = Wish::List(vec![Wish::Whole(640), Wish::Whole(480)]);
        assert_eq!(set("size", &pair).map(|r| r.size), Ok(Some([640, 480])));
        assert_eq!(text("size", "640x480").map(|r| r.size), Ok(Some([640, 480])));
        assert_eq!(text("spp", "16").map(|r| r.spp), Ok(Some(16)));
        assert_eq!(
            set("guiding", &Wish::Flag(true)).map(|r| r.guiding),
            text("guiding", "auto").map(|r| r.guiding)
        );
        let groups = Wish::Named(vec![("key".into(), Wish::List(vec![Wish::Whole(0)]))]);
        let named = set("light_groups", &groups).map(|r| r.light_groups);
        assert_eq!(named, text("light_groups", "key=0").map(|r| r.light_groups));
        for wrong in [("size", "640"), ("size", "0x5"), ("crop", "5,0,5,1"), ("crop", "1,2,3")] {
            assert!(text(wrong.0, wrong.1).is_err(), "{wrong:?}");
        }
        assert!(text("crop", "0,0,10,10").is_ok());
        assert!(text("bvh_cache", "").is_err());
    }

    #[test]
    fn what_is_of_another_sort_is_told_from_what_is_out_of_range() {
        let list = Wish::List(vec![]);
        for setting in Request::SETTINGS {
            let problem = setting.set(&mut Request::default(), &list);
            let is_list = matches!(setting.form, Form::List | Form::Lists);
            assert_eq!(matches!(problem, Err(Problem::Kind(_))), !is_list, "{}", setting.name);
        }
        assert!(matches!(text("spp", "0"), Err(Problem::Value(_))));
        assert!(matches!(set("seed", &Wish::Whole(-1)), Err(Problem::Value(_))));
        let Err(Problem::Value(problem)) = text("sampler", "zsobl") else { panic!("no error") };
        assert!(problem.ends_with("did you mean zsobol?"), "{problem}");
    }
}
