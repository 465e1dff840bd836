//! A document with the files that it includes, as if it were one.

use super::MjcfError;
use crate::robot::document::{self, Element};
use roxmltree::{Document, Node};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Component, Path};

/// Far above any robot.
const MAX_FILES: usize = 64;

/// A document of MJCF with the files that it includes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MjcfFiles {
    /// The document.
    pub text: String,
    /// The files, each under its path from the folder of the document.
    pub included: BTreeMap<String, String>,
}

impl MjcfFiles {
    /// A document whose files are in `folder`, or in folders in there. They are read now.
    pub fn beside(text: String, folder: &Path) -> Result<Self, MjcfError> {
        let mut included: BTreeMap<String, String> = BTreeMap::new();
        let mut found = requested(&text, None)?;
        while let Some(Request { element, line, file }) = found.pop() {
            if included.contains_key(&file) {
                return Err(MjcfError::IncludedTwice { element, line, file });
            }
            if included.len() == MAX_FILES {
                return Err(MjcfError::TooManyFiles { allowed: MAX_FILES });
            }
            let text = match std::fs::read_to_string(folder.join(&file)) {
                Ok(text) => text,
                Err(reason) => {
                    return Err(MjcfError::Unreadable { element, line, file, reason: reason.to_string() });
                }
            };
            found.extend(requested(&text, Some(&file))?);
            included.insert(file, text);
        }
        Ok(Self { text, included })
    }
}

/// A file that is to be included.
struct Request {
    element: String,
    line: u32,
    file: String,
}

/// What a text includes.
fn requested(text: &str, file: Option<&str>) -> Result<Vec<Request>, MjcfError> {
    let document = parsed(text, file)?;
    let root = document.root_element();
    let found = root.descendants().filter(|node| node.tag_name().name() == "include");
    found.map(|node| request(&Element::new(node, None).of_file(file))).collect()
}

fn request(element: &Element) -> Result<Request, MjcfError> {
    let (file, line) = (element.attribute("file")?, element.line());
    match beside(file) {
        Some(file) => Ok(Request { element: element.to_string(), line, file }),
        None => {
            let (element, file) = (element.to_string(), document::shorten(file));
            Err(MjcfError::FileElsewhere { element, line, file })
        }
    }
}

/// The path without its dots, unless it leads out of the folder.
fn beside(file: &str) -> Option<String> {
    let mut parts = Vec::new();
    for part in Path::new(file).components() {
        match part {
            Component::Normal(name) => parts.push(name.to_str()?),
            Component::CurDir => {}
            Component::Prefix(_) | Component::RootDir | Component::ParentDir => return None,
        }
    }
    if parts.is_empty() { None } else { Some(parts.join("/")) }
}

fn parsed<'a>(text: &'a str, file: Option<&str>) -> Result<Document<'a>, MjcfError> {
    document::parse(text).map_err(|source| match file {
        Some(file) => MjcfError::Included { file: file.to_owned(), source },
        None => source.into(),
    })
}

/// The documents of the files.
pub(super) struct Documents<'a> {
    main: Document<'a>,
    included: Vec<(&'a str, Document<'a>)>,
}

impl<'a> Documents<'a> {
    pub(super) fn parse(files: &'a MjcfFiles) -> Result<Self, MjcfError> {
        if files.included.len() > MAX_FILES {
            return Err(MjcfError::TooManyFiles { allowed: MAX_FILES });
        }
        let main = parsed(&files.text, None)?;
        let included = files.included.iter().map(|(file, text)| (file.as_str(), text));
        let included = included.map(|(file, text)| Ok((file, parsed(text, Some(file))?)));
        Ok(Self { main, included: included.collect::<Result<_, MjcfError>>()? })
    }
}

/// Elements, with those of a file in the place of the element that includes it.
pub(super) struct Library<'a> {
    root: Node<'a, 'a>,
    files: HashMap<&'a str, Node<'a, 'a>>,
}

impl<'a> Library<'a> {
    /// Fails where a file is included twice, so that no inclusion has a circle.
    pub(super) fn new(documents: &'a Documents<'a>) -> Result<Self, MjcfError> {
        let root = document::outermost(&documents.main, "mujoco")?;
        let files: HashMap<&str, Node> =
            documents.included.iter().map(|(file, document)| (*file, document.root_element())).collect();
        let mut seen = HashSet::new();
        let all = documents.included.iter().map(|(file, document)| (Some(*file), document.root_element()));
        for (file, within) in std::iter::once((None, root)).chain(all) {
            for node in within.descendants().filter(|node| node.tag_name().name() == "include") {
                let Request { element, line, file } = request(&Element::new(node, None).of_file(file))?;
                if !files.contains_key(file.as_str()) {
                    let reason = "the text of this file is not given".to_owned();
                    return Err(MjcfError::Unreadable { element, line, file, reason });
                }
                if !seen.insert(file.clone()) {
                    return Err(MjcfError::IncludedTwice { element, line, file });
                }
            }
        }
        Ok(Self { root, files })
    }

    pub(super) fn root(&self) -> Element<'a> {
        Element::new(self.root, self.root.attribute("model"))
    }

    /// What an element holds.
    pub(super) fn children(&self, parent: &Element<'a>) -> Vec<Element<'a>> {
        let mut found = Vec::new();
        self.gather(parent, &mut found);
        found
    }

    /// No deeper than there are files.
    fn gather(&self, parent: &Element<'a>, found: &mut Vec<Element<'a>>) {
        for node in parent.node().children().filter(Node::is_element) {
            let element = Element::new(node, node.attribute("name")).of_file(parent.file);
            if element.tag() != "include" {
                found.push(element);
                continue;
            }
            let file = node.attribute("file").and_then(beside);
            if let Some((file, root)) = file.and_then(|file| self.files.get_key_value(file.as_str())) {
                self.gather(&Element::new(*root, None).of_file(Some(file)), found);
            }
        }
    }
}
