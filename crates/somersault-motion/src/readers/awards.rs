//! Tables of judges' awards, as results of competitions and public judged sets have them.
//!
//! ```text
//! diver,dive,difficulty,J1,J2,J3,J4,J5,J6,J7,points
//! Ann,107B,3.1,7.5,8.0,7.5,7.0,7.5,8.0,7.5,69.75
//! ```
//! A line names the columns, in any order; every other line is a dive. Awards are in a column for each judge, whose name ends in a number
//! (`J1`, `judge 2`, `award_3`, `E4`), or in one column `judge_scores`, `judges` or `awards` as a list, `[7.5, 8.0, 7.5]`. There must be a
//! `difficulty` (`dd`, `degree of difficulty`, `tariff`). `points` (`dive_score`, `final_score`, `score`, `total`), `athlete` (`diver`,
//! `name`, `competitor`) and `dive` (`action_type`, `dive number`, `code`) may be left out. Case, blanks, dots, hyphens and underscores in
//! names do not matter. Cells are separated by commas, semicolons or tabs, with decimal points or commas.
//!
//! Points are those of the awards that count ([`panel_score`]). Where the table states others, it is a repair that is listed; dives of
//! other numbers of judges than 3, 5 or 7, as in synchronised diving, are left out.

use super::csv::{Rows, separator};
use super::{Place, ReadError, Repair, Repairs, decoded, number, number_of_cell, shorten, unexpected};
use crate::scoring::{PanelScore, panel_score};
use ::csv::StringRecord;

/// How far points may be from those that are stated: these have two decimals.
const ROUNDED: f64 = 0.00501;
/// The longest text of a message.
const LONGEST: usize = 40;

/// A dive and what its judges gave.
#[derive(Debug, Clone, PartialEq)]
pub struct AwardedDive {
    /// The award of each judge.
    pub awards: Vec<f64>,
    /// Degree of difficulty.
    pub difficulty: f64,
    /// Points by the awards that count, and which do.
    pub panel: PanelScore,
    /// Points that the table states.
    pub stated: Option<f64>,
    /// Whose it is.
    pub athlete: Option<String>,
    /// Its number, as the table has it.
    pub dive: Option<String>,
    /// Line of the table, from 1.
    pub line: usize,
}

impl AwardedDive {
    /// Mean of the awards that count, from 0 to 10: a score that does not depend on the difficulty.
    pub fn score(&self) -> f64 {
        let counted = self.panel.counts.iter().filter(|counts| **counts).count();
        self.panel.points / (self.difficulty * counted as f64)
    }
}

/// A table of awards.
#[derive(Debug, Clone, PartialEq)]
pub struct AwardTable {
    /// Its dives.
    pub dives: Vec<AwardedDive>,
    /// What was put right or left out.
    pub repairs: Vec<Repair>,
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Column {
    Award(usize),
    Awards,
    Difficulty,
    Points,
    Athlete,
    Dive,
    Other,
}

impl Column {
    fn of(name: &str) -> Self {
        let plain: String =
            name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
        let letters = plain.trim_end_matches(|c: char| c.is_ascii_digit());
        if let ("j" | "judge" | "award" | "e" | "judgescore" | "judgesscore", Ok(judge)) =
            (letters, plain[letters.len()..].parse())
        {
            return Self::Award(judge);
        }
        match plain.as_str() {
            "judgescores" | "judgesscores" | "judges" | "awards" => Self::Awards,
            "difficulty" | "dd" | "degreeofdifficulty" | "tariff" => Self::Difficulty,
            "points" | "score" | "divescore" | "finalscore" | "total" | "totalscore" => Self::Points,
            "athlete" | "diver" | "name" | "competitor" => Self::Athlete,
            "dive" | "divenumber" | "diveno" | "actiontype" | "code" => Self::Dive,
            _ => Self::Other,
        }
    }
}

/// Columns of a table.
struct Columns {
    awards: Vec<usize>,
    /// Of awards as a list.
    list: Option<usize>,
    difficulty: usize,
    points: Option<usize>,
    athlete: Option<usize>,
    dive: Option<usize>,
}

impl Columns {
    fn of(place: Place, header: &StringRecord, repairs: &mut Repairs) -> Result<Self, ReadError> {
        let found: Vec<Column> = header.iter().map(Column::of).collect();
        let names = || header.iter().collect::<Vec<_>>().join(",");
        for (k, column) in found.iter().enumerate() {
            if *column != Column::Other && found[..k].contains(column) {
                return Err(unexpected(place, &header[k], "each column once"));
            }
            if *column == Column::Other && !header[k].is_empty() {
                repairs.decide(place, format!("the column `{}` is left out", shorten(&header[k], LONGEST)));
            }
        }
        let at = |column: Column| found.iter().position(|other| *other == column);
        let mut judges: Vec<(usize, usize)> = found
            .iter()
            .enumerate()
            .filter_map(
                |(k, column)| if let Column::Award(judge) = column { Some((*judge, k)) } else { None },
            )
            .collect();
        judges.sort_unstable();
        let (awards, list) = (judges.into_iter().map(|(_, k)| k).collect::<Vec<_>>(), at(Column::Awards));
        match (awards.is_empty() == list.is_some(), at(Column::Difficulty)) {
            (true, Some(difficulty)) => Ok(Self {
                awards,
                list,
                difficulty,
                points: at(Column::Points),
                athlete: at(Column::Athlete),
                dive: at(Column::Dive),
            }),
            _ => {
                let allowed = "a column `difficulty`, and a column for each judge or one of lists of awards";
                Err(unexpected(place, &names(), allowed))
            }
        }
    }
}

/// The table in `bytes`; a `strict` reader refuses what needs a repair.
///
/// ```
/// use somersault_motion::readers::awards;
///
/// let table = awards::read(b"diver,dd,J1,J2,J3\nAnn,2.0,7.5,8,7\n", true)?;
/// assert_eq!((table.dives[0].panel.points, table.dives[0].score()), (45.0, 7.5));
/// # Ok::<(), somersault_motion::readers::ReadError>(())
/// ```
pub fn read(bytes: &[u8], strict: bool) -> Result<AwardTable, ReadError> {
    let mut repairs = if strict { Repairs::refused() } else { Repairs::allowed() };
    let text = decoded(bytes, &mut repairs)?;
    let mut rows = Rows::within(&text, &text, separator(&text));
    let mut record = StringRecord::new();
    let Some(head) = rows.next(&mut record) else {
        let allowed = "the names of columns".to_owned();
        return Err(ReadError::Truncated { place: Place::Line(1), allowed });
    };
    let columns = Columns::of(head, &record, &mut repairs)?;
    let width = record.len();
    let mut dives = Vec::new();
    while let Some(place) = rows.next(&mut record) {
        if record.iter().all(str::is_empty) {
            continue;
        }
        if record.len() != width {
            let found = format!("{} cells", record.len());
            return Err(unexpected(place, &found, format!("{width} cells, as many as names")));
        }
        dives.extend(dive(place, &record, &columns, &mut repairs)?);
    }
    if dives.is_empty() {
        return Err(ReadError::Truncated { place: head, allowed: "at least one dive after it".to_owned() });
    }
    Ok(AwardTable { dives, repairs: repairs.into_list() })
}

/// A line of the table, if its judges are a panel.
fn dive(
    place: Place,
    record: &StringRecord,
    columns: &Columns,
    repairs: &mut Repairs,
) -> Result<Option<AwardedDive>, ReadError> {
    const AWARD: &str = "an award";
    let mut awards = Vec::new();
    match columns.list {
        Some(k) => {
            let bare = record[k].trim_matches(['[', ']', '(', ')', ' ']);
            let apart = |c: char| matches!(c, ',' | ';' | ' ');
            for cell in bare.split(apart).map(|cell| cell.trim_matches(['\'', '"'])).filter(|c| !c.is_empty())
            {
                awards.push(number(place, cell, AWARD)?);
            }
        }
        None => {
            // a panel of five leaves the columns of the others empty
            for cell in columns.awards.iter().map(|k| &record[*k]).filter(|cell| !cell.is_empty()) {
                awards.push(number_of_cell(place, cell, AWARD, repairs)?);
            }
        }
    }
    if !matches!(awards.len(), 3 | 5 | 7) {
        let allowed = "the awards of 3, 5 or 7 judges";
        let error = unexpected(place, &format!("{} awards", awards.len()), allowed);
        repairs.instead_of(error, format!("dives of {} judges are left out", awards.len()))?;
        return Ok(None);
    }
    let difficulty = number_of_cell(place, &record[columns.difficulty], "a degree of difficulty", repairs)?;
    let found = record.iter().collect::<Vec<_>>().join(",");
    let panel =
        panel_score(&awards, difficulty).map_err(|error| unexpected(place, &found, error.to_string()))?;
    let text = |column: Option<usize>| column.map(|k| record[k].to_owned()).filter(|cell| !cell.is_empty());
    let stated = match text(columns.points) {
        Some(cell) => Some(number_of_cell(place, &cell, "points", repairs)?),
        None => None,
    };
    if let Some(stated) = stated.filter(|stated| (stated - panel.points).abs() > ROUNDED) {
        let error =
            unexpected(place, &stated.to_string(), format!("{:.2} points by the awards", panel.points));
        repairs.instead_of(error, "points that are stated are not those of awards and difficulty")?;
    }
    let line = if let Place::Line(line) = place { line } else { 0 };
    let (athlete, dive) = (text(columns.athlete), text(columns.dive));
    Ok(Some(AwardedDive { awards, difficulty, panel, stated, athlete, dive, line }))
}
