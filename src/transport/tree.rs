//! The basis of the transportation simplex: a spanning tree over sources and targets.
//!
//! Each point knows its parent, the flow on the edge to it, and the set of targets below it as bits. The sets make a pivot
//! short: whether a point is above a target is one bit, above a source it is its parent's bit, and the part of the tree
//! that swings over is one set, whose values move eight at a time. Sources are in no set: a source's value follows from
//! its parent's.

use super::cost::LANES;
use super::start::Closing;

/// A set of targets: `W` words of 64.
type TargetSet<const W: usize> = [u64; W];

#[inline(always)]
fn join<const W: usize>(set: &mut TargetSet<W>, other: &TargetSet<W>) {
    for (word, other) in set.iter_mut().zip(other) {
        *word |= other;
    }
}

#[inline(always)]
fn leave<const W: usize>(set: &mut TargetSet<W>, other: &TargetSet<W>) {
    for (word, other) in set.iter_mut().zip(other) {
        *word &= !other;
    }
}

#[inline(always)]
fn without<const W: usize>(mut set: TargetSet<W>, other: &TargetSet<W>) -> TargetSet<W> {
    leave(&mut set, other);
    set
}

#[inline(always)]
fn holds<const W: usize>(words: &[u64; W], point: usize) -> bool {
    words[(point / 64) % W] >> (point % 64) & 1 == 1
}

#[inline(always)]
fn insert<const W: usize>(words: &mut [u64; W], point: usize) {
    words[(point / 64) % W] |= 1 << (point % 64);
}

/// Calls `visit` with every point of a set of words, ascending.
#[inline(always)]
fn for_each_point<const W: usize>(words: &[u64; W], mut visit: impl FnMut(usize)) {
    for (w, &word) in words.iter().enumerate() {
        let mut rest = word;
        while rest != 0 {
            visit(w * 64 + rest.trailing_zeros() as usize);
            rest &= rest - 1;
        }
    }
}

/// Adds `step` to the values of a set's targets.
#[inline(always)]
pub(super) fn shift<const W: usize>(set: &TargetSet<W>, values: &mut [[f64; LANES]], step: f64) {
    for (w, word) in set.iter().enumerate() {
        let mut rest = *word;
        let mut block = w * (64 / LANES);
        while rest != 0 {
            let lanes_of = rest & ((1 << LANES) - 1);
            if lanes_of != 0 {
                let lanes = &mut values[block];
                for lane in 0..LANES {
                    lanes[lane] += if lanes_of & (1 << lane) != 0 {
                        step
                    } else {
                        0.0
                    };
                }
            }
            rest >>= LANES;
            block += 1;
        }
    }
}

/// A point of the tree, seen from below.
#[derive(Clone, Copy, Debug)]
struct Branch<const W: usize> {
    /// The point on the other side that it hangs from; the root's means nothing.
    parent: usize,
    /// Grains on the edge to the parent.
    flow: i64,
    /// All targets below, itself if it is one.
    below: TargetSet<W>,
}

/// What a pivot did: which targets swung over, and with which end of the entering edge.
pub(super) struct Swing<const W: usize> {
    /// The targets that moved; none, where a source moved alone.
    pub moved: TargetSet<W>,
    /// Whether the entering edge's source moved with them, to hang from its target.
    pub with_source: bool,
}

/// A rooted spanning tree with its flows. The root is a target.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree<const W: usize> {
    sources: Vec<Branch<W>>,
    targets: Vec<Branch<W>>,
    root: usize,
    /// Scratch: for each target the sources that hang from it, for each source the targets, and points to visit.
    children_of_target: Vec<[u64; W]>,
    children_of_source: Vec<[u64; W]>,
    queue: Vec<usize>,
}

impl<const W: usize> Tree<W> {
    /// Builds the tree from the steps of a start.
    pub(super) fn plant(&mut self, sources: usize, targets: usize, steps: &[Closing]) {
        let leaf = Branch {
            parent: 0,
            flow: 0,
            below: [0; W],
        };
        self.sources.clear();
        self.sources.resize(sources, leaf);
        self.targets.clear();
        self.targets.resize(targets, leaf);
        for (j, branch) in self.targets.iter_mut().enumerate() {
            insert(&mut branch.below, j);
        }
        for &step in steps {
            match step {
                Closing::Source {
                    closed,
                    parent,
                    grains,
                } => {
                    let branch = &mut self.sources[closed];
                    branch.parent = parent;
                    branch.flow = grains;
                    let below = branch.below;
                    join(&mut self.targets[parent].below, &below);
                    self.root = parent;
                }
                Closing::Target {
                    closed,
                    parent,
                    grains,
                } => {
                    let branch = &mut self.targets[closed];
                    branch.parent = parent;
                    branch.flow = grains;
                    let below = branch.below;
                    join(&mut self.sources[parent].below, &below);
                }
            }
        }
    }

    /// The target that a source hangs from.
    #[inline(always)]
    pub(super) fn parent_of(&self, source: usize) -> usize {
        self.sources[source].parent
    }

    /// Brings in the edge from `source` to `target` and takes out the edge whose flow falls to zero first.
    #[inline(always)]
    pub(super) fn pivot(&mut self, source: usize, target: usize) -> Swing<W> {
        // Around the cycle the flow rises on the entering edge, and falls and rises in turn from there: it falls on the
        // edges from sources up on the source's way, from targets up on the target's way.
        let mut least = i64::MAX;
        let mut leaving = source;
        let mut with_source = true;
        let mut source_way = 0;
        let mut at = source;
        loop {
            let branch = &self.sources[at];
            if holds(&branch.below, target) {
                break;
            }
            if branch.flow < least {
                least = branch.flow;
                leaving = at;
            }
            let up = branch.parent;
            source_way += 1;
            let branch = &self.targets[up];
            if holds(&branch.below, target) {
                break;
            }
            at = branch.parent;
            source_way += 1;
        }
        // Whoever is above the source's parent is above the source.
        let parent = self.sources[source].parent;
        let mut target_way = 0;
        let mut at = target;
        loop {
            let branch = &self.targets[at];
            if holds(&branch.below, parent) {
                break;
            }
            if branch.flow < least {
                least = branch.flow;
                leaving = at;
                with_source = false;
            }
            let up = branch.parent;
            target_way += 1;
            let branch = &self.sources[up];
            if up == source || holds(&branch.below, parent) {
                break;
            }
            at = branch.parent;
            target_way += 1;
        }
        let cycle = Cycle {
            flow: least,
            leaving,
        };
        let moved = if with_source {
            cycle.swing(
                (&mut self.sources, source, source_way),
                (&mut self.targets, target, target_way),
            )
        } else {
            cycle.swing(
                (&mut self.targets, target, target_way),
                (&mut self.sources, source, source_way),
            )
        };
        Swing { moved, with_source }
    }

    /// Computes potentials with `u_i + v_j = w_ij` on every edge, the root's 0, from the root outward.
    pub(super) fn potentials(
        &mut self,
        cost: impl Fn(usize, usize) -> f64,
        source_values: &mut [f64],
        target_values: &mut [f64],
    ) {
        self.list_children();
        target_values[self.root] = 0.0;
        self.queue.clear();
        self.queue.push(self.root);
        let mut visited = 0;
        while let Some(&target) = self.queue.get(visited) {
            visited += 1;
            let value = target_values[target];
            for_each_point(&self.children_of_target[target], |source| {
                let value = cost(source, target) - value;
                source_values[source] = value;
                for_each_point(&self.children_of_source[source], |target| {
                    target_values[target] = cost(source, target) - value;
                    self.queue.push(target);
                });
            });
        }
    }

    /// Visits all edges with their flows, by source, then target. Call after [`Tree::potentials`].
    pub(super) fn for_each_edge(&self, mut visit: impl FnMut(usize, usize, i64)) {
        for (source, (branch, below)) in self
            .sources
            .iter()
            .zip(&self.children_of_source)
            .enumerate()
        {
            let parent = branch.parent;
            let mut edges = *below;
            insert(&mut edges, parent);
            for_each_point(&edges, |target| {
                let flow = if target == parent {
                    branch.flow
                } else {
                    self.targets[target].flow
                };
                visit(source, target, flow);
            });
        }
    }

    fn list_children(&mut self) {
        self.children_of_source.clear();
        self.children_of_source.resize(self.sources.len(), [0; W]);
        self.children_of_target.clear();
        self.children_of_target.resize(self.targets.len(), [0; W]);
        for (i, branch) in self.sources.iter().enumerate() {
            insert(&mut self.children_of_target[branch.parent], i);
        }
        for (j, branch) in self.targets.iter().enumerate() {
            if j != self.root {
                insert(&mut self.children_of_source[branch.parent], j);
            }
        }
    }
}

/// What is known of a pivot once its cycle has been walked.
struct Cycle {
    /// Grains that go around.
    flow: i64,
    /// The point whose edge to its parent leaves.
    leaving: usize,
}

impl Cycle {
    /// Swings the subtree with the leaving edge over to the other end of the entering edge.
    ///
    /// Each way is its side's branches, the entering edge's point there, and how many points lie from it up to where the
    /// ways meet, that one not counted. The leaving edge lies on the first way.
    #[inline(always)]
    fn swing<const W: usize>(
        &self,
        (near, start, mut near_way): (&mut [Branch<W>], usize, usize),
        (far, partner, far_way): (&mut [Branch<W>], usize, usize),
    ) -> TargetSet<W> {
        let moved = near[self.leaving].below;

        let mut at = partner;
        let mut rest = far_way;
        while rest > 0 {
            let branch = &mut far[at];
            branch.flow -= self.flow;
            join(&mut branch.below, &moved);
            at = branch.parent;
            if rest == 1 {
                break;
            }
            let branch = &mut near[at];
            branch.flow += self.flow;
            join(&mut branch.below, &moved);
            at = branch.parent;
            rest -= 2;
        }

        // The way from the start to the leaving edge turns round: who was above hangs below now.
        let mut at = start;
        let mut turned = Branch {
            parent: partner,
            flow: self.flow,
            below: moved,
        };
        let mut above = loop {
            let old = std::mem::replace(&mut near[at], turned);
            near_way -= 1;
            let up = old.parent;
            if at == self.leaving {
                break up;
            }
            let old_up = std::mem::replace(
                &mut far[up],
                Branch {
                    parent: at,
                    flow: old.flow - self.flow,
                    below: without(moved, &old.below),
                },
            );
            near_way -= 1;
            turned = Branch {
                parent: old.parent,
                flow: old_up.flow + self.flow,
                below: without(moved, &old_up.below),
            };
            at = old_up.parent;
        };

        while near_way > 0 {
            let branch = &mut far[above];
            branch.flow += self.flow;
            leave(&mut branch.below, &moved);
            above = branch.parent;
            if near_way == 1 {
                break;
            }
            let branch = &mut near[above];
            branch.flow -= self.flow;
            leave(&mut branch.below, &moved);
            above = branch.parent;
            near_way -= 2;
        }
        moved
    }
}
