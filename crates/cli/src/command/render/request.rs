//! The settings of a render as command-line options: one option for each setting that [`Request`]
//! declares.

use clap::builder::{TypedValueParser, ValueParser};
use clap::{Arg, ArgAction, ArgMatches, Command, FromArgMatches};
use snell_render::{Denoise, Form, Request, Setting, Wish};
use std::ffi::OsString;
use std::ops::Deref;

/// The settings given on the command line, as a request.
#[derive(Clone, Debug, Default)]
pub struct RequestOptions(Request);

impl RequestOptions {
    /// Takes the denoiser that is installed, if one is asked for.
    pub fn use_own_denoiser(&mut self) {
        self.0.denoise = self.0.denoise.take().map(|_| Denoise::Found);
    }

    /// Asks for a picture of another size.
    pub fn resize(&mut self, size: [u32; 2]) {
        self.0.size = Some(size);
    }

    /// Asks for a picture with its noise.
    pub fn forget_denoiser(&mut self) {
        self.0.denoise = None;
    }
}

impl Deref for RequestOptions {
    type Target = Request;

    fn deref(&self) -> &Request {
        &self.0
    }
}

impl clap::Args for RequestOptions {
    fn augment_args(command: Command) -> Command {
        command.args(Request::SETTINGS.iter().map(argument))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for RequestOptions {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut options = Self::default();
        options.update_from_arg_matches(matches)?;
        Ok(options)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        for setting in Request::SETTINGS {
            let Some(wish) = wish(setting, matches) else { continue };
            setting.set(&mut self.0, &wish).map_err(|problem| {
                let message = format!("--{}: {}\n", setting.option(), problem.text());
                clap::Error::raw(clap::error::ErrorKind::ValueValidation, message)
            })?;
        }
        Ok(())
    }
}

/// The clap argument for a setting.
fn argument(setting: &'static Setting) -> Arg {
    let argument = Arg::new(setting.name)
        .long(setting.option())
        .help(setting.summary())
        .help_heading(setting.heading.text())
        .value_parser(parser(setting));
    let argument = match setting.short {
        Some(letter) => argument.short(letter),
        None => argument,
    };
    let argument = match setting.alias {
        Some(alias) => argument.visible_alias(alias),
        None => argument,
    };
    match setting.form {
        Form::Flag => argument.action(ArgAction::SetTrue).value_parser(clap::value_parser!(bool)),
        Form::OptionalValue => argument
            .value_name(setting.value_name)
            .num_args(0..=1)
            .require_equals(true)
            .default_missing_value(""),
        Form::Value => argument.value_name(setting.value_name).allow_negative_numbers(true),
        Form::Path => argument.value_name(setting.value_name),
        Form::List | Form::Lists => {
            argument.value_name(setting.value_name).action(ArgAction::Append)
        }
    }
}

/// The parser of a setting's values, which refuses values that are not possible.
fn parser(setting: &'static Setting) -> ValueParser {
    if matches!(setting.form, Form::Path | Form::OptionalValue) {
        return clap::builder::OsStringValueParser::new()
            .try_map(|value: OsString| match value.into_string() {
                Ok(text) if text.is_empty() && setting.form == Form::OptionalValue => {
                    Ok(Wish::Flag(true))
                }
                Ok(text) => checked(setting, Wish::Text(text)),
                Err(value) => Ok(Wish::Path(value.into())),
            })
            .into();
    }
    ValueParser::from(|text: &str| checked(setting, Wish::Text(text.to_string())))
}

fn checked(setting: &Setting, wish: Wish) -> Result<Wish, String> {
    match setting.set(&mut Request::default(), &wish) {
        Ok(()) => Ok(wish),
        Err(problem) => Err(problem.text().to_string()),
    }
}

/// The value given for a setting; `None` if there is none.
fn wish(setting: &Setting, matches: &ArgMatches) -> Option<Wish> {
    match setting.form {
        Form::Flag => matches.get_flag(setting.name).then_some(Wish::Flag(true)),
        Form::List | Form::Lists => {
            let items = matches.get_many::<Wish>(setting.name)?;
            let joined = items.flat_map(|item| match (setting.form, item) {
                (Form::List, Wish::Text(list)) => {
                    list.split(',').map(|name| Wish::Text(name.to_string())).collect()
                }
                _ => vec![item.clone()],
            });
            Some(Wish::List(joined.collect()))
        }
        Form::Value | Form::OptionalValue | Form::Path => {
            matches.get_one::<Wish>(setting.name).cloned()
        }
    }
}
