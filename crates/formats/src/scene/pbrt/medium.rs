//! Participating media.

use super::Builder;
use super::fault::Fault;
use super::lexer::Lexer;
use super::params::Params;

impl Builder<'_> {
    /// `MakeNamedMedium "name" "string type" "homogeneous" ...`
    pub(super) fn make_named_medium(&mut self, params: Params) -> Result<(), Fault> {
        self.note("media", params.at, || "media are not supported; everything stands in clear air".into());
        Ok(())
    }

    /// `MediumInterface "inside" "outside"`
    pub(super) fn medium_interface(&mut self, lexer: &mut Lexer) -> Result<(), Fault> {
        let (inside, _) = lexer.expect_string("the name of the medium inside")?;
        let outside =
            if lexer.string_follows() { lexer.expect_string("the name of the medium outside")?.0 } else { inside };
        self.state.media = [inside.into(), outside.into()];
        Ok(())
    }
}
