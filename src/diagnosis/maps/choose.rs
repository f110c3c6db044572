// SPDX-License-Identifier: MIT OR Apache-2.0
//! Which map to look at: of all maps that explain the bearings the one that says most.

use super::super::finding::Kind;
use super::super::parts::subproblem::SubProblem;
use super::super::shapes::normalized_map::NormalizedMap;
use super::explaining_map::{ExplainingMap, explaining_map, explaining_maps, mirror_images};
use super::from_bearings::map_from_bearings;
use super::wall_family::WallFamily;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::problem::{Map, Undetermined};
use crate::reconstruction::Progress;
use alloc::vec::Vec;

/// What is looked at.
pub enum Evidence {
    /// A map.
    Map {
        map: Map,
        /// What it has lost, and why.
        lost: Vec<Undetermined>,
        /// How many times larger the residuals of the next best map are; NaN when none was looked for.
        margin: f64,
    },
    /// The shape that the bearings show by themselves.
    Bearings(NormalizedMap),
}

/// Evidence, and the standard deviation of a bearing \[rad\] to judge it by.
pub struct Chosen {
    pub evidence: Evidence,
    pub noise: f64,
}

/// Noise \[rad\] up to which bearings are looked at for shapes when a map has told the noise, which it
/// may have from a wrong minimum: half a degree.
const SHOWN_NOISE: f64 = 0.01;

impl SubProblem {
    /// The shape that the bearings show by themselves, for this noise \[rad\].
    fn shown_by_bearings(&self, noise: f64) -> Option<Chosen> {
        let normalized = map_from_bearings(&self.problem, noise)?;
        Some(Chosen {
            evidence: Evidence::Bearings(normalized),
            noise,
        })
    }

    /// A map made from the bearings, whether they determine it or not; `None` when there is none.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when `progress` says so.
    pub fn choose(&self, progress: &mut Option<Progress<'_>>) -> Result<Option<Chosen>, Error> {
        let stated = self.stated_noise();
        if let Some(shown) = self.shown_by_bearings(stated.unwrap_or(0.0)) {
            return Ok(Some(shown));
        }
        let found = match explaining_map(&self.problem, progress) {
            Err(error @ Error::Interrupted) => return Err(error),
            Err(_) | Ok(None) => return Ok(None),
            Ok(Some(found)) => found,
        };
        let noise = stated.unwrap_or_else(|| self.rms_and_noise(&found.map).1);
        if stated.is_none()
            && let Some(shown) = self.shown_by_bearings(f64::min(noise, SHOWN_NOISE))
        {
            return Ok(Some(shown));
        }
        let mut rivals = mirror_images(&self.problem, &found.map);
        rivals.push(found.rival);
        let margin = self.margin(found.variance, &rivals);
        let (map, lost) = self
            .more_telling_map(&found, noise)
            .unwrap_or((found.map, found.undetermined));
        Ok(Some(Chosen {
            evidence: Evidence::Map { map, lost, margin },
            noise,
        }))
    }

    /// Another map than the one that was found, if its shape is known and tells more: where something is
    /// free, the bearings allow many.
    fn more_telling_map(
        &self,
        found: &ExplainingMap,
        noise: f64,
    ) -> Option<(Map, Vec<Undetermined>)> {
        let own = self.examined(&found.map, noise);
        let doubt = own.is_none_or(|own| own.directions.iter().any(|d| d.largest > 1.0));
        let mut others = found.others.clone();
        if doubt || !found.undetermined.is_empty() {
            others.extend(
                explaining_maps(&self.problem)
                    .into_iter()
                    .map(|other| other.map),
            );
        }
        let first = core::iter::once((&found.map, &found.undetermined[..]));
        let maps: Vec<_> = first
            .chain(others.iter().map(|map| (map, &[][..])))
            .collect();
        let member = |pick: &dyn Fn(&WallFamily) -> Option<Map>, kind: Kind| {
            maps.iter().find_map(|(map, lost)| {
                let member = pick(&WallFamily::of(&self.problem, map, lost)?)?;
                let map = self.refine_member(member, &found.map, noise)?;
                self.has_shape(&map, kind, noise).then_some(map)
            })
        };
        member(&WallFamily::aligned, Kind::LinesOfViewsAndOfLandmarks)
            .or_else(|| member(&WallFamily::compact, Kind::CollinearLandmarks))
            .or_else(|| self.midpoint_map(&found.map, &others, noise))
            .map(|map| (map, Vec::new()))
    }

    /// A given map; if it shows nothing, what the bearings show, or a wall whose noise has been taken for
    /// depth, or a circle that noise has left.
    pub fn choose_given(&self, map: Map, hopeless: bool) -> Chosen {
        let stated = self.stated_noise();
        let (_, estimated) = self.rms_and_noise(&map);
        let noise = stated.unwrap_or(estimated);
        let mut lost = self.infinite(&map, noise);
        let mut map = map;
        let mut margin = f64::NAN;
        if !hopeless {
            let own = self.examined(&map, noise);
            if own.is_some_and(|own| own.causes.is_empty()) {
                if let Some(shown) = self.shown_by_bearings(f64::min(noise, SHOWN_NOISE)) {
                    return shown;
                }
                let wall = WallFamily::of(&self.problem, &map, &lost)
                    .and_then(|family| self.refine_member(family.compact()?, &map, noise))
                    .filter(|member| self.has_shape(member, Kind::CollinearLandmarks, noise));
                let four = || {
                    let few = self.problem.landmarks() == 4;
                    let others = few.then(|| explaining_maps(&self.problem))?.into_iter();
                    let others: Vec<_> = others.map(|other| other.map).collect();
                    self.midpoint_map(&map, &others, noise)
                };
                if let Some(member) = wall.or_else(four) {
                    (map, lost) = (member, Vec::new());
                }
            }
            if self.problem.views() == 3 {
                let best = estimated * self.mean_weight();
                margin = self.margin(best * best, &mirror_images(&self.problem, &map));
            }
        }
        Chosen {
            evidence: Evidence::Map { map, lost, margin },
            noise,
        }
    }

    /// How far the next best map is from the best, by their costs per degree of freedom.
    fn margin(&self, best: f64, rivals: &[f64]) -> f64 {
        let next = rivals.iter().copied().fold(f64::INFINITY, f64::min);
        // Costs of exact maps are rounding.
        let rounding = 16.0 * f64::EPSILON * self.mean_weight();
        let floor = rounding * rounding;
        (f64::max(next, floor) / f64::max(best, floor)).sqrt()
    }
}
