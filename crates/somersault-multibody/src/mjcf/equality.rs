//! Constraints between joints, which become joints that follow others.

use super::MjcfError;
use super::defaults::{Defaults, MAIN};
use super::joint::Kind;
use super::library::Library;
use super::parts::Parts;
use super::report::Report;
use crate::robot::document::Element;

/// Makes joints follow others, or fixes them, as the sections say.
pub(super) fn couple<'a>(
    parts: &mut Parts<'a>,
    sections: &[Element<'a>],
    library: &Library<'a>,
    defaults: &'a Defaults<'a>,
    report: &mut Report<'a>,
) -> Result<(), MjcfError> {
    for section in sections.iter().filter(|section| section.tag() == "equality") {
        for element in library.children(section) {
            let styled = defaults.styled(element, "equality", MAIN)?;
            if styled.at("active").word("active", &["false", "true"])? == Some("false") {
                continue;
            }
            if element.tag() != "joint" {
                report.acts(&element, "constraints other than of two joints are not read")?;
                continue;
            }
            let [a0, a1, higher @ ..] = styled.overlaid("polycoef", [0.0, 1.0, 0.0, 0.0, 0.0])?;
            let follower = parts.joint(&element, "joint1")?;
            let leader = match element.attribute_or_none("joint2") {
                Some(_) => Some(parts.joint(&element, "joint2")?),
                None => None,
            };
            let single = |joint: usize| matches!(parts.kind(joint), Some(Kind::Hinge | Kind::Slide));
            if ![Some(follower), leader].into_iter().flatten().all(single) {
                return Err(MjcfError::refused(&element, "only hinges and slides follow others"));
            }
            if leader.is_some() && higher.iter().any(|x| *x != 0.0) {
                report.acts(&element, "a polynomial that is not linear is not read")?;
            } else if parts.is_held(follower) {
                report.acts(&element, "`joint1` follows another joint already")?;
            } else {
                parts.hold(follower, leader, a0, a1);
            }
        }
    }
    Ok(())
}
