//! The reference pages of integrators and samplers: `docs/user/parameters/integrators.md` and
//! `samplers.md`.

use crate::{Filter, IntegratorKind, LightSamplerKind, SamplerKind};

/// The page of integrators in Markdown.
pub fn integrators_page() -> String {
    let mut text = "# Integrators

An integrator computes the light that arrives along a camera ray. `-i NAME` chooses one, and
`integrator=\"NAME\"` in Python. `cargo xtask parameters` writes this page from the declarations in
the source. [The command line](../command-line.md#how-light-is-computed) has the options that
integrators take.
"
    .to_string();
    for kind in IntegratorKind::ALL {
        let (name, depth) = (kind.name(), kind.default_max_depth());
        let scene = if kind == IntegratorKind::Aov { " --aov normal" } else { "" };
        let command = format!(
            "snell render scenes/balls.scn -i {name}{scene} --size 320x240 --spp 256 \
            -o integrator-{name}.jpg"
        );
        text += &section(name, kind.text(), kind == IntegratorKind::default());
        text += &picture(&format!("the integrator {name}"), &command);
        text += &format!(
            "\nDefaults: {} samples per pixel, at most {depth} bounces after the first hit.\n",
            kind.default_spp()
        );
    }
    text
}

/// The page of samplers, filters and light samplers in Markdown.
pub fn samplers_page() -> String {
    let mut text = "# Samplers and filters

A sampler makes the random numbers of a render, a filter combines samples into pixels, and a light
sampler chooses one light among many. None of them changes what the picture converges to.
`cargo xtask parameters` writes this page from the declarations in the source.
[The command line](../command-line.md#sampling) has the options.
"
    .to_string();
    for kind in SamplerKind::ALL {
        let name = kind.name();
        let command = format!(
            "snell render cornell-box --sampler {name} --spp 4 --size 240x180 -o sampler-{name}.jpg"
        );
        text += &section(name, kind.text(), kind == SamplerKind::default());
        text += &picture(&format!("four samples per pixel of the sampler {name}"), &command);
    }
    text += "\n## Filters\n\n| `--filter` | what it is | radius in pixels |\n|---|---|---|\n";
    for kind in Filter::ALL {
        let (name, about) = (kind.name(), marked(kind.text(), kind == Filter::default()));
        text += &format!("| `{name}` | {about} | {} |\n", kind.radius());
    }
    text += "\n## Light samplers\n\n| `--light-sampler` | what it is |\n|---|---|\n";
    for kind in LightSamplerKind::ALL {
        let about = marked(kind.text(), kind == LightSamplerKind::default());
        text += &format!("| `{}` | {about} |\n", kind.name());
    }
    text
}

fn section(name: &str, about: &str, is_default: bool) -> String {
    format!("\n## `{name}`\n\n{}\n", marked(about, is_default))
}

fn marked(about: &str, is_default: bool) -> String {
    format!("{about}{}", if is_default { " This is the default." } else { "" })
}

fn picture(about: &str, command: &str) -> String {
    format!("\n<!-- picture: {about} -->\n```sh\n{command}\n```\n")
}
