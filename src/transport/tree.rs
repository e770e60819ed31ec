//! The basis of the transportation simplex: a spanning tree over sources and targets.
//!
//! Each point knows its parent, the flow on the edge to it, and the set of points below it as bits. The sets make a pivot
//! short: whether a point is above another is one bit, the part of the tree that swings over is one set, and its points
//! are visited by scanning bits, with no list to keep in order.

use super::start::Closing;

/// A set of points; `W` words of 64 for each side.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointSet<const W: usize> {
    pub sources: [u64; W],
    pub targets: [u64; W],
}

impl<const W: usize> PointSet<W> {
    const EMPTY: Self = Self {
        sources: [0; W],
        targets: [0; W],
    };

    #[inline(always)]
    fn join(&mut self, other: &Self) {
        for w in 0..W {
            self.sources[w] |= other.sources[w];
            self.targets[w] |= other.targets[w];
        }
    }

    #[inline(always)]
    fn leave(&mut self, other: &Self) {
        for w in 0..W {
            self.sources[w] &= !other.sources[w];
            self.targets[w] &= !other.targets[w];
        }
    }

    #[inline(always)]
    fn without(mut self, other: &Self) -> Self {
        self.leave(other);
        self
    }
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
pub(super) fn for_each_point<const W: usize>(words: &[u64; W], mut visit: impl FnMut(usize)) {
    for (w, &word) in words.iter().enumerate() {
        let mut rest = word;
        while rest != 0 {
            visit(w * 64 + rest.trailing_zeros() as usize);
            rest &= rest - 1;
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
    /// Itself and all points below.
    below: PointSet<W>,
}

/// What a pivot did: which points swung over, and from which end of the entering edge they hang now.
pub(super) struct Swing<const W: usize> {
    /// The points that moved.
    pub moved: PointSet<W>,
    /// Whether they hang from the entering edge's target, and hold its source.
    pub with_source: bool,
}

/// A rooted spanning tree with its flows. The root is a target.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree<const W: usize> {
    sources: Vec<Branch<W>>,
    targets: Vec<Branch<W>>,
    root: usize,
    /// Scratch: for each target the sources below it, for each source the targets below it, and points to visit.
    below_target: Vec<[u64; W]>,
    below_source: Vec<[u64; W]>,
    queue: Vec<usize>,
}

impl<const W: usize> Tree<W> {
    /// Builds the tree from the steps of a start.
    pub(super) fn plant(&mut self, sources: usize, targets: usize, steps: &[Closing]) {
        let leaf = Branch {
            parent: 0,
            flow: 0,
            below: PointSet::EMPTY,
        };
        self.sources.clear();
        self.sources.resize(sources, leaf);
        self.targets.clear();
        self.targets.resize(targets, leaf);
        for (i, branch) in self.sources.iter_mut().enumerate() {
            insert(&mut branch.below.sources, i);
        }
        for (j, branch) in self.targets.iter_mut().enumerate() {
            insert(&mut branch.below.targets, j);
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
                    self.targets[parent].below.join(&below);
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
                    self.sources[parent].below.join(&below);
                }
            }
        }
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
            if holds(&branch.below.targets, target) {
                break;
            }
            if branch.flow < least {
                least = branch.flow;
                leaving = at;
            }
            let up = branch.parent;
            source_way += 1;
            let branch = &self.targets[up];
            if holds(&branch.below.targets, target) {
                break;
            }
            at = branch.parent;
            source_way += 1;
        }
        let mut target_way = 0;
        let mut at = target;
        loop {
            let branch = &self.targets[at];
            if holds(&branch.below.sources, source) {
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
            if holds(&branch.below.sources, source) {
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
            for_each_point(&self.below_target[target], |source| {
                let value = cost(source, target) - value;
                source_values[source] = value;
                for_each_point(&self.below_source[source], |target| {
                    target_values[target] = cost(source, target) - value;
                    self.queue.push(target);
                });
            });
        }
    }

    /// Visits all edges with their flows, by source, then target. Call after [`Tree::potentials`].
    pub(super) fn for_each_edge(&self, mut visit: impl FnMut(usize, usize, i64)) {
        for (source, (branch, below)) in self.sources.iter().zip(&self.below_source).enumerate() {
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
        self.below_source.clear();
        self.below_source.resize(self.sources.len(), [0; W]);
        self.below_target.clear();
        self.below_target.resize(self.targets.len(), [0; W]);
        for (i, branch) in self.sources.iter().enumerate() {
            insert(&mut self.below_target[branch.parent], i);
        }
        for (j, branch) in self.targets.iter().enumerate() {
            if j != self.root {
                insert(&mut self.below_source[branch.parent], j);
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
    ) -> PointSet<W> {
        let moved = near[self.leaving].below;

        let mut at = partner;
        let mut rest = far_way;
        while rest > 0 {
            let branch = &mut far[at];
            branch.flow -= self.flow;
            branch.below.join(&moved);
            at = branch.parent;
            if rest == 1 {
                break;
            }
            let branch = &mut near[at];
            branch.flow += self.flow;
            branch.below.join(&moved);
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
                    below: moved.without(&old.below),
                },
            );
            near_way -= 1;
            turned = Branch {
                parent: old.parent,
                flow: old_up.flow + self.flow,
                below: moved.without(&old_up.below),
            };
            at = old_up.parent;
        };

        while near_way > 0 {
            let branch = &mut far[above];
            branch.flow += self.flow;
            branch.below.leave(&moved);
            above = branch.parent;
            if near_way == 1 {
                break;
            }
            let branch = &mut near[above];
            branch.flow -= self.flow;
            branch.below.leave(&moved);
            above = branch.parent;
            near_way -= 2;
        }
        moved
    }
}
