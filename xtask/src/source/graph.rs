//! Files and the arrows between them: levels, and circles.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Files with arrows to the files that they use.
pub(crate) struct Graph {
    pub(crate) nodes: Vec<String>,
    /// From, to, and the line of the first use.
    pub(crate) arrows: BTreeMap<(usize, usize), usize>,
}

/// Files that all use each other, directly or not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Circle {
    pub(crate) members: BTreeSet<usize>,
    /// The shortest way around, without coming back to the first.
    pub(crate) shortest: Vec<usize>,
}

impl Graph {
    pub(crate) fn new(nodes: Vec<String>, arrows: BTreeMap<(usize, usize), usize>) -> Self {
        Self { nodes, arrows }
    }

    /// What a node uses.
    pub(crate) fn used_by(&self, from: usize) -> impl Iterator<Item = usize> + '_ {
        self.arrows.range((from, 0)..=(from, usize::MAX)).map(|((_, to), _)| *to)
    }

    /// The shortest way from a node along the arrows to each other one, and back to itself: who comes before whom.
    fn ways_from(&self, start: usize) -> BTreeMap<usize, usize> {
        let mut before = BTreeMap::new();
        let mut waiting = VecDeque::from([start]);
        while let Some(at) = waiting.pop_front() {
            for next in self.used_by(at) {
                before.entry(next).or_insert_with(|| {
                    waiting.push_back(next);
                    at
                });
            }
        }
        before
    }

    /// Every circle, in the order of its first file.
    pub(crate) fn circles(&self) -> Vec<Circle> {
        let ways: Vec<_> = (0..self.nodes.len()).map(|node| self.ways_from(node)).collect();
        let mut placed: BTreeSet<usize> = BTreeSet::new();
        let mut circles = Vec::new();
        for node in 0..self.nodes.len() {
            if placed.contains(&node) || !ways[node].contains_key(&node) {
                continue;
            }
            let members: BTreeSet<usize> =
                ways[node].keys().copied().filter(|other| ways[*other].contains_key(&node)).collect();
            placed.extend(&members);
            let loops = members.iter().map(|start| around(&ways[*start], *start));
            let shortest = loops.min_by_key(Vec::len).unwrap_or_default();
            circles.push(Circle { members, shortest });
        }
        circles
    }

    /// Level of each node: one above the highest that it uses. Those of a circle share theirs.
    pub(crate) fn levels(&self) -> Vec<usize> {
        let circles = self.circles();
        let group = |node: usize| {
            let circle = circles.iter().find(|circle| circle.members.contains(&node));
            circle.map_or_else(|| BTreeSet::from([node]), |circle| circle.members.clone())
        };
        let groups: Vec<BTreeSet<usize>> = (0..self.nodes.len()).map(group).collect();
        let mut levels = vec![1; self.nodes.len()];
        // Each round settles at least one level.
        for _ in 0..self.nodes.len() {
            for node in 0..self.nodes.len() {
                let used = groups[node].iter().flat_map(|member| self.used_by(*member));
                let below = used.filter(|used| !groups[node].contains(used)).map(|used| levels[used]).max();
                levels[node] = 1 + below.unwrap_or(0);
            }
        }
        levels
    }

    /// `a.rs -> b.rs -> a.rs`, with the line of each use.
    pub(crate) fn shown(&self, way: &[usize]) -> String {
        let mut text = String::new();
        for (at, from) in way.iter().enumerate() {
            let to = way[(at + 1) % way.len()];
            let line = self.arrows.get(&(*from, to)).copied().unwrap_or_default();
            text += &format!("{}:{line} -> ", self.nodes[*from]);
        }
        text + way.first().map_or("", |first| self.nodes[*first].as_str())
    }
}

/// The way from a node back to itself.
fn around(before: &BTreeMap<usize, usize>, start: usize) -> Vec<usize> {
    let mut way = vec![start];
    let mut at = before[&start];
    while at != start {
        way.push(at);
        at = before[&at];
    }
    way[1..].reverse();
    way
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(count: usize, arrows: &[(usize, usize)]) -> Graph {
        let nodes = (0..count).map(|node| format!("{node}.rs")).collect();
        Graph::new(nodes, arrows.iter().map(|arrow| (*arrow, 7)).collect())
    }

    #[test]
    fn levels_stand_on_what_is_used() {
        assert_eq!(graph(4, &[(0, 1), (1, 2), (0, 3)]).levels(), [3, 2, 1, 1]);
        assert_eq!(graph(4, &[(0, 1), (1, 2), (2, 1), (2, 3)]).levels(), [3, 2, 2, 1]);
        assert!(graph(4, &[(0, 1), (1, 2), (0, 3), (0, 2)]).circles().is_empty());
    }

    #[test]
    fn a_circle_is_named_by_its_shortest_loop() {
        let graph = graph(5, &[(0, 1), (1, 2), (2, 3), (3, 0), (2, 1), (4, 0)]);
        let circles = graph.circles();
        assert_eq!(circles.len(), 1);
        assert_eq!(circles[0].members, BTreeSet::from([0, 1, 2, 3]));
        assert_eq!(graph.shown(&circles[0].shortest), "1.rs:7 -> 2.rs:7 -> 1.rs");
    }

    #[test]
    fn a_longer_loop_runs_along_its_arrows() {
        let graph = graph(3, &[(0, 1), (1, 2), (2, 0)]);
        assert_eq!(graph.circles()[0].shortest, [0, 1, 2]);
    }

    #[test]
    fn two_circles_are_two() {
        let circles = graph(4, &[(0, 1), (1, 0), (1, 2), (2, 3), (3, 2)]).circles();
        let members: Vec<_> = circles.into_iter().map(|circle| circle.members).collect();
        assert_eq!(members, [BTreeSet::from([0, 1]), BTreeSet::from([2, 3])]);
    }
}
