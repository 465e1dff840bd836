//! Classes of defaults.

use super::MjcfError;
use super::library::Library;
use crate::robot::DocumentError;
use crate::robot::document::Element;
use std::collections::HashMap;

/// The number of the class that holds where no other is named.
pub(super) const MAIN: usize = 0;

/// An attribute is looked for in every class around an element, and in every element of these.
const MAX_DEPTH: usize = 64;
const MAX_ELEMENTS: usize = 256;

struct Class<'a> {
    /// The class around it, and how many elements that had when this one was read: later ones do not reach it.
    parent: Option<(usize, usize)>,
    depth: usize,
    /// What it says of each tag.
    elements: Vec<Element<'a>>,
}

/// The classes of a document.
pub(super) struct Defaults<'a> {
    classes: Vec<Class<'a>>,
    names: HashMap<&'a str, usize>,
}

impl<'a> Defaults<'a> {
    pub(super) fn read(sections: &[Element<'a>], library: &Library<'a>) -> Result<Self, MjcfError> {
        let main = Class { parent: None, depth: 0, elements: Vec::new() };
        let mut defaults = Self { classes: vec![main], names: HashMap::from([("main", MAIN)]) };
        let sections = sections.iter().rev().filter(|section| section.tag() == "default");
        let mut open: Vec<(Element, Option<usize>)> = sections.map(|section| (*section, None)).collect();
        while let Some((element, parent)) = open.pop() {
            let name = element.attribute_or_none("class");
            let class = match (parent, name) {
                (None, Some(name)) => {
                    defaults.names.insert(name, MAIN);
                    MAIN
                }
                (None, None) => MAIN,
                (Some(_), None) => return Err(element.missing("class").into()),
                (Some(outer), Some(name)) => {
                    if defaults.names.insert(name, defaults.classes.len()).is_some() {
                        return Err(element.called(name).duplicate().into());
                    }
                    let around = &defaults.classes[outer];
                    let (depth, parent) = (around.depth + 1, Some((outer, around.elements.len())));
                    if depth > MAX_DEPTH {
                        return Err(MjcfError::refused(&element, "classes are nested too deeply"));
                    }
                    defaults.classes.push(Class { parent, depth, elements: Vec::new() });
                    defaults.classes.len() - 1
                }
            };
            let mut nested = Vec::new();
            for child in library.children(&element) {
                if child.tag() == "default" {
                    nested.push((child, Some(class)));
                } else {
                    let elements = &mut defaults.classes[class].elements;
                    if elements.len() == MAX_ELEMENTS {
                        return Err(MjcfError::refused(&child, "its class has too many elements"));
                    }
                    elements.push(child);
                }
            }
            open.extend(nested.into_iter().rev());
        }
        Ok(defaults)
    }

    /// All elements of all classes.
    pub(super) fn elements(&self) -> impl Iterator<Item = &Element<'a>> {
        self.classes.iter().flat_map(|class| &class.elements)
    }

    /// The class that an attribute of an element names, if it names one.
    pub(super) fn named(
        &self,
        element: &Element<'a>,
        attribute: &'static str,
    ) -> Result<Option<usize>, MjcfError> {
        let Some(name) = element.attribute_or_none(attribute) else { return Ok(None) };
        let found = self.names.get(name).copied();
        found.map(Some).ok_or_else(|| MjcfError::unknown_name(element, "class", name))
    }

    /// An element with what its class, or the class around it, says of a tag.
    pub(super) fn styled(
        &'a self,
        own: Element<'a>,
        tag: &'static str,
        around: usize,
    ) -> Result<Styled<'a>, MjcfError> {
        let class = self.named(&own, "class")?.unwrap_or(around);
        Ok(Styled { own, tag, defaults: Some((self, class)) })
    }

    /// What a class and those around it say of a tag, from the innermost outwards.
    fn inherited(&'a self, class: usize, tag: &'static str) -> impl Iterator<Item = Element<'a>> {
        let first = Some((class, usize::MAX));
        let classes = std::iter::successors(first, |&(class, _)| self.classes[class].parent);
        let seen = classes.flat_map(|(class, count)| self.classes[class].elements.iter().take(count).rev());
        seen.copied().filter(move |element| element.tag() == tag)
    }
}

/// An element, and where its attributes come from.
#[derive(Clone, Copy)]
pub(super) struct Styled<'a> {
    pub(super) own: Element<'a>,
    tag: &'static str,
    defaults: Option<(&'a Defaults<'a>, usize)>,
}

impl<'a> Styled<'a> {
    /// An element that has no defaults.
    pub(super) fn plain(own: Element<'a>) -> Self {
        Self { own, tag: "", defaults: None }
    }

    /// The innermost element that has one of the attributes, which one, and another that it has.
    pub(super) fn first_of(
        &self,
        attributes: &[&'static str],
    ) -> Option<(Element<'a>, &'static str, Option<&'static str>)> {
        let said = |at: Element<'a>| {
            let mut given = attributes.iter().copied().filter(|name| at.attribute_or_none(name).is_some());
            given.next().map(|first| (at, first, given.next()))
        };
        self.layers().find_map(said)
    }

    /// The element and its defaults, from the innermost outwards.
    fn layers(&self) -> impl Iterator<Item = Element<'a>> {
        let tag = self.tag;
        let inherited = self.defaults.into_iter().flat_map(move |(all, class)| all.inherited(class, tag));
        std::iter::once(self.own).chain(inherited)
    }

    /// Those that have the attribute.
    fn sources(&self, attribute: &'static str) -> impl Iterator<Item = Element<'a>> {
        self.layers().filter(move |element| element.attribute_or_none(attribute).is_some())
    }

    /// The element that says what the attribute is; its own if none does.
    pub(super) fn at(&self, attribute: &'static str) -> Element<'a> {
        self.sources(attribute).next().unwrap_or(self.own)
    }

    pub(super) fn has(&self, attribute: &'static str) -> bool {
        self.sources(attribute).next().is_some()
    }

    pub(super) fn text(&self, attribute: &'static str) -> Option<&'a str> {
        self.at(attribute).attribute_or_none(attribute)
    }

    /// Numbers of which a default may give the last ones; those given where nothing says them.
    pub(super) fn overlaid<const N: usize>(
        &self,
        attribute: &'static str,
        mut numbers: [f64; N],
    ) -> Result<[f64; N], DocumentError> {
        let sources: Vec<Element> = self.sources(attribute).collect();
        for source in sources.iter().rev() {
            source.fill(attribute, &mut numbers)?;
            if numbers.iter().any(|x| x.is_infinite()) {
                return Err(source.bad_number(attribute, N, source.attribute(attribute)?));
            }
        }
        Ok(numbers)
    }
}
