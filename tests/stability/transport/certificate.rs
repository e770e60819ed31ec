//! What is wrong with a transport plan, and what a linear program of another's making says.
//!
//! Tolerances. Costs are sums of at most 99 products, rounded to a few 1e-16 relatively; the tie-break may cost 5e-10 of
//! the optimum. Duals are sums of costs along a tree way, each step rounding by at most 1.1e-16 of the largest potential;
//! potentials stay within some ten largest costs, ways within some twenty steps, which makes 2e-14 of the largest cost.
//! Masses are whole units of 2^-55 or so; a hundred clusters round by less than 1e-14.

use super::clouds::Clouds;
use carpaint::transport::{Cost, Plan};
use good_lp::solvers::microlp::microlp;
use good_lp::{Expression, ProblemVariables, Solution, SolverModel, variable};

/// Rounding allowed to duals, as a part of the largest cost.
const DUAL_ROUNDING: f64 = 2e-14;

/// What is wrong with a plan, judged from the problem alone.
pub fn faults(clouds: &Clouds, cost: Cost, plan: &Plan) -> Option<String> {
    let scaled = |masses: &[f64]| -> Vec<f64> {
        let sum: f64 = masses.iter().sum();
        masses.iter().map(|mass| mass / sum).collect()
    };
    let (p, q) = (scaled(&clouds.source_masses), scaled(&clouds.target_masses));
    let w = |i: usize, j: usize| cost.between(clouds.source[i], clouds.target[j]);

    if plan.entries.len() > p.len() + q.len() - 1 {
        return Some(format!("{} entries", plan.entries.len()));
    }
    let mut sent = vec![0.0; p.len()];
    let mut arrived = vec![0.0; q.len()];
    let mut spent = 0.0;
    for (k, entry) in plan.entries.iter().enumerate() {
        let place = |k: usize| (plan.entries[k].source, plan.entries[k].target);
        if k > 0 && place(k - 1) >= place(k) {
            return Some(format!("entry {k} is out of order"));
        }
        if entry.mass <= 0.0 || entry.mass.is_nan() {
            return Some(format!("entry {k} moves {}", entry.mass));
        }
        sent[entry.source] += entry.mass;
        arrived[entry.target] += entry.mass;
        spent += entry.mass * w(entry.source, entry.target);
    }
    for (side, moved, masses) in [("source", &sent, &p), ("target", &arrived, &q)] {
        for (i, (&moved, &mass)) in moved.iter().zip(masses).enumerate() {
            if moved <= 0.0 || (moved - mass).abs() > 1e-12 {
                return Some(format!("{side} {i} has {mass:e}, moves {moved:e}"));
            }
            if side == "source" && (moved / mass - 1.0).abs() > 1e-9 {
                return Some(format!("source {i} has {mass:e}, moves {moved:e}"));
            }
        }
    }
    let mut largest = 0.0_f64;
    let mut least_slack = f64::INFINITY;
    for i in 0..p.len() {
        for j in 0..q.len() {
            largest = largest.max(w(i, j));
            least_slack = least_slack.min(w(i, j) - plan.source_duals[i] - plan.target_duals[j]);
        }
    }
    let rounding = DUAL_ROUNDING * largest;
    if least_slack < -rounding || least_slack.is_nan() {
        return Some(format!(
            "duals exceed a cost by {:e} of the largest",
            -least_slack / largest
        ));
    }
    let dot = |masses: &[f64], duals: &[f64]| -> f64 {
        masses
            .iter()
            .zip(duals)
            .map(|(mass, dual)| mass * dual)
            .sum()
    };
    let dual = dot(&p, &plan.source_duals) + dot(&q, &plan.target_duals);
    let gap = spent - dual;
    if (spent - plan.cost).abs() > 1e-12 * spent
        || (gap - plan.gap).abs() > rounding + 1e-12 * spent
    {
        return Some(format!(
            "cost {} said {}, gap {gap:e} said {:e}",
            spent, plan.cost, plan.gap
        ));
    }
    if gap > 1e-9 * spent + rounding {
        return Some(format!(
            "gap {gap:e} of {spent:e}, largest cost {largest:e}"
        ));
    }
    None
}

/// `good_lp`'s optimum, or why there is none.
pub fn reference(clouds: &Clouds) -> Result<f64, String> {
    const SCALE: f64 = 1e5;
    let problem = clouds.problem();
    let (p, q) = (problem.source().masses(), problem.target().masses());
    let mut variables = ProblemVariables::new();
    let x = variables.add_vector(variable().min(0.0), p.len() * q.len());
    let cost: Vec<f64> = clouds
        .source
        .iter()
        .flat_map(|&from| {
            clouds
                .target
                .iter()
                .map(move |&to| Cost::Distance.between(from, to))
        })
        .collect();
    let largest = cost.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let objective = x.iter().zip(&cost).map(|(&x, &w)| x * (w / largest));
    let objective: Expression = objective.sum();
    let mut model = variables.minimise(objective).using(microlp);
    for (i, mass) in p.iter().enumerate() {
        let row: Expression = x[i * q.len()..(i + 1) * q.len()].iter().sum();
        model.add_constraint(row.eq(mass * SCALE));
    }
    for (j, mass) in q.iter().enumerate().take(q.len() - 1) {
        let column: Expression = x[j..].iter().step_by(q.len()).sum();
        model.add_constraint(column.eq(mass * SCALE));
    }
    let solution = model.solve().map_err(|error| error.to_string())?;
    let x: Vec<f64> = x.iter().map(|&x| solution.value(x) / SCALE).collect();
    for (i, mass) in p.iter().enumerate() {
        let sum: f64 = x[i * q.len()..(i + 1) * q.len()].iter().sum();
        if (sum - mass).abs() > 1e-9 {
            return Err(format!("source {i} has {mass}, moves {sum}"));
        }
    }
    for (j, mass) in q.iter().enumerate() {
        let sum: f64 = x[j..].iter().step_by(q.len()).sum();
        if (sum - mass).abs() > 1e-9 {
            return Err(format!("target {j} has {mass}, gets {sum}"));
        }
    }
    if let Some(x) = x.iter().find(|x| **x < -1e-9) {
        return Err(format!("moves {x}"));
    }
    Ok(x.iter().zip(&cost).map(|(x, w)| x * w).sum())
}
