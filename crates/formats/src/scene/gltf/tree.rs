//! Files whose nodes are no trees: a node below two parents is shown below each of them, as common
//! loaders do, and a node below itself is shown once.

use crate::{Input, ReadError};
use serde_json::Value;

/// Bytes that a copied node or channel is charged, beside those of its text: its place in the
/// document, in the scene and in the motion.
const COPY_BYTES: u64 = 2048;

/// Gives every node of a document one parent, and returns warnings about what was changed. Further
/// parents of a node get copies of it, with the nodes below and with the channels of animations
/// that move them. Documents in which nodes refer to what is not there are left as they are: later
/// checks report them.
pub(super) fn untangle(input: &Input, document: &mut Value) -> Result<Vec<String>, ReadError> {
    let Some(mut children) = children(document) else { return Ok(Vec::new()) };
    let mut warnings = Vec::new();
    drop_repeated(&mut children, &mut warnings);
    let mut references = vec![0usize; children.len()];
    children.iter().flatten().for_each(|&child| references[child] += 1);
    if warnings.is_empty() && references.iter().all(|&count| count <= 1) {
        return Ok(Vec::new());
    }
    let mut trees = Trees {
        input,
        has_parent: vec![false; children.len()],
        on_path: vec![false; children.len()],
        below: children.iter().map(|_| None).collect(),
        original: (0..children.len()).collect(),
        children,
        weights: Vec::new(),
        warnings,
    };
    let Some(nodes) = document.get_mut("nodes").and_then(Value::as_array_mut) else {
        return Ok(Vec::new());
    };
    trees.weights = nodes.iter().map(|node| node.to_string().len() as u64).collect();
    for root in (0..references.len()).filter(|&i| references[i] == 0) {
        trees.grow(root)?;
    }
    let Trees { below, original, mut warnings, .. } = trees;
    let mut is_copied = vec![false; nodes.len()];
    original[nodes.len()..].iter().for_each(|&i| is_copied[i] = true);
    for child in (0..references.len()).filter(|&i| references[i] > 1 && is_copied[i]) {
        let problem = "has more than one parent, which glTF does not allow; it is shown below each";
        add(&mut warnings, format!("/nodes/{child} {problem}"));
    }
    for &i in &original[nodes.len()..] {
        let copy = nodes[i].clone();
        nodes.push(copy);
    }
    // Nodes that no root leads to lie on cycles, which later checks refuse.
    for (node, below) in nodes.iter_mut().zip(below) {
        if let (Some(below), Some(map)) = (below, node.as_object_mut()) {
            map.insert("children".into(), below.into());
        }
    }
    copy_channels(input, document, &original)?;
    Ok(warnings)
}

/// The children of each node; `None` if the document is not as it should be.
fn children(document: &Value) -> Option<Vec<Vec<usize>>> {
    let nodes = document.get("nodes")?.as_array()?;
    let below = |node: &Value| {
        let Some(children) = node.as_object()?.get("children") else { return Some(Vec::new()) };
        let number = |child: &Value| whole(child).filter(|&i| i < nodes.len());
        children.as_array()?.iter().map(number).collect()
    };
    nodes.iter().map(below).collect()
}

/// A whole number; `2.0` counts too.
fn whole(value: &Value) -> Option<usize> {
    let number = value.as_f64()?;
    (number.fract() == 0.0 && (0.0..9e15).contains(&number)).then_some(number as usize)
}

/// Removes children that a node names twice.
fn drop_repeated(children: &mut [Vec<usize>], warnings: &mut Vec<String>) {
    let mut last_parent = vec![usize::MAX; children.len()];
    for (parent, below) in children.iter_mut().enumerate() {
        below.retain(|&child| {
            let is_new = std::mem::replace(&mut last_parent[child], parent) != parent;
            if !is_new {
                let named = "is named more than once by its parent; it is shown once there";
                add(warnings, format!("/nodes/{child} {named}"));
            }
            is_new
        });
    }
}

/// Adds a warning, unless it is there, or many are.
fn add(warnings: &mut Vec<String>, warning: String) {
    const MOST: usize = 8;
    if warnings.len() < MOST && !warnings.contains(&warning) {
        warnings.push(warning);
    }
}

/// Nodes that are being ordered into trees. Nodes past those of the file are copies.
struct Trees<'a> {
    input: &'a Input,
    /// The children of each node of the file.
    children: Vec<Vec<usize>>,
    /// Length of each node of the file as text.
    weights: Vec<u64>,
    /// True for each node of the file that has got its parent.
    has_parent: Vec<bool>,
    /// True for each node of the file that is above the node being read, or is that node.
    on_path: Vec<bool>,
    /// The children of each node and copy, once they are known.
    below: Vec<Option<Vec<usize>>>,
    /// The node of the file that each node shows.
    original: Vec<usize>,
    warnings: Vec<String>,
}

impl Trees<'_> {
    /// Orders what is below a root.
    fn grow(&mut self, root: usize) -> Result<(), ReadError> {
        // The nodes from the root downwards, and how many of their children have been visited.
        let mut path = vec![(root, 0)];
        self.start(root);
        while let Some((node, visited)) = path.last_mut() {
            let (node, parent) = (*node, self.original[*node]);
            let Some(&child) = self.children[parent].get(*visited) else {
                self.on_path[parent] = false;
                path.pop();
                continue;
            };
            *visited += 1;
            if self.on_path[child] {
                add(
                    &mut self.warnings,
                    format!(
                        "/nodes/{child} is below itself; it is not shown again below \
                            /nodes/{parent}"
                    ),
                );
                continue;
            }
            if path.len() > self.input.options.limits.depth {
                // Too deep, which a later check reports.
                self.below[node].get_or_insert_default().push(child);
                continue;
            }
            let shown = if std::mem::replace(&mut self.has_parent[child], true) {
                self.copy(child)?
            } else {
                child
            };
            self.below[node].get_or_insert_default().push(shown);
            self.start(shown);
            path.push((shown, 0));
        }
        Ok(())
    }

    fn start(&mut self, node: usize) {
        self.on_path[self.original[node]] = true;
        self.below[node] = Some(Vec::new());
    }

    /// A new node that shows the node `i` of the file.
    fn copy(&mut self, i: usize) -> Result<usize, ReadError> {
        self.input.charge(COPY_BYTES + 8 * self.weights[i], "a node with more than one parent")?;
        self.original.push(i);
        self.below.push(None);
        Ok(self.original.len() - 1)
    }
}

/// Lets the copies of moving nodes move too. `original` names the node of the file that each node
/// shows.
fn copy_channels(input: &Input, document: &mut Value, original: &[usize]) -> Result<(), ReadError> {
    let mut copies = std::collections::BTreeMap::<usize, Vec<usize>>::new();
    for (copy, &i) in original.iter().enumerate().filter(|(copy, i)| copy != *i) {
        copies.entry(i).or_default().push(copy);
    }
    let animations = document.get_mut("animations").and_then(Value::as_array_mut);
    for animation in animations.into_iter().flatten() {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else {
            continue;
        };
        for i in 0..channels.len() {
            let Some(node) = moved_node(&channels[i]) else { continue };
            let weight = channels[i].to_string().len() as u64;
            for &copy in copies.get(&node).into_iter().flatten() {
                input.charge(COPY_BYTES + 8 * weight, "a moving node with more than one parent")?;
                let mut channel = channels[i].clone();
                if let Some(number) = channel.pointer_mut("/target/node") {
                    *number = copy.into();
                }
                if let Some(Value::String(pointer)) = channel.pointer_mut(POINTER)
                    && let Some(rest) = pointer.strip_prefix(&format!("/nodes/{node}/"))
                {
                    *pointer = format!("/nodes/{copy}/{rest}");
                }
                channels.push(channel);
            }
        }
    }
    Ok(())
}

/// Where a channel of `KHR_animation_pointer` has its pointer.
const POINTER: &str = "/target/extensions/KHR_animation_pointer/pointer";

/// The node that a channel moves.
fn moved_node(channel: &Value) -> Option<usize> {
    if let Some(node) = channel.pointer("/target/node") {
        return whole(node);
    }
    let pointer = channel.pointer(POINTER)?.as_str()?;
    pointer.strip_prefix("/nodes/")?.split('/').next()?.parse().ok()
}
