// SPDX-License-Identifier: MIT OR Apache-2.0
//! The choice of the map to examine: of all maps that explain the bearings, the one whose shape explains most.

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

/// What is examined.
pub enum Evidence {
    /// A map.
    Map {
        map: Map,
        /// Its undetermined views and landmarks, and why they are.
        lost: Vec<Undetermined>,
        /// How many times larger the residuals of the next best map are; NaN when none was looked for.
        margin: f64,
    },
    /// A map constructed from the bearings, which show its shape by themselves.
    Bearings(NormalizedMap),
}

/// What is examined, and the standard deviation of a bearing \[rad\] to judge it by.
pub struct Chosen {
    pub evidence: Evidence,
    pub noise: f64,
}

impl SubProblem {
    /// The shape that the bearings show by themselves, for this noise \[rad\].
    fn shown_by_bearings(&self, noise: f64) -> Option<Chosen> {
        let normalized = map_from_bearings(&self.problem, noise, self.options.maps.sigmas)?;
        Some(Chosen {
            evidence: Evidence::Bearings(normalized),
            noise,
        })
    }

    /// Maps from the null spaces of tensors.
    fn explaining_maps(
        &self,
        progress: &mut Option<Progress<'_>>,
    ) -> Result<impl Iterator<Item = Map> + use<>, Error> {
        let found = explaining_maps(&self.problem, &self.options.maps, progress)?;
        Ok(found.into_iter().map(|found| found.map))
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
        let found = match explaining_map(&self.problem, &self.options.maps, progress) {
            Err(error @ Error::Interrupted) => return Err(error),
            Err(_) | Ok(None) => return Ok(None),
            Ok(Some(found)) => found,
        };
        let noise = stated.unwrap_or_else(|| self.rms_and_noise(&found.map).1);
        if stated.is_none()
            && let Some(shown) =
                self.shown_by_bearings(f64::min(noise, self.options.maps.max_unstated_noise))
        {
            return Ok(Some(shown));
        }
        let mut rivals = mirror_images(&self.problem, &found.map, progress)?;
        rivals.push(found.rival);
        let margin = self.margin(found.variance, &rivals);
        let (map, lost) = self
            .more_telling_map(&found, noise, progress)?
            .unwrap_or((found.map, found.undetermined));
        Ok(Some(Chosen {
            evidence: Evidence::Map { map, lost, margin },
            noise,
        }))
    }

    /// Where a direction is free, many maps explain the bearings: returns one other than the map found if its shape
    /// explains why.
    fn more_telling_map(
        &self,
        found: &ExplainingMap,
        noise: f64,
        progress: &mut Option<Progress<'_>>,
    ) -> Result<Option<(Map, Vec<Undetermined>)>, Error> {
        let known = self.examined(&found.map, noise);
        // Along a direction in which noise moves a point by its whole unit, the map found is arbitrary.
        let doubt = known.is_none_or(|known| known.directions.iter().any(|d| d.largest > 1.0));
        let mut others = found.others.clone();
        if doubt || !found.undetermined.is_empty() {
            others.extend(self.explaining_maps(progress)?);
        }
        let first = core::iter::once((&found.map, &found.undetermined[..]));
        let maps: Vec<_> = first
            .chain(others.iter().map(|map| (map, &[][..])))
            .collect();
        let mut member = |pick: &dyn Fn(&WallFamily) -> Option<Map>, kind: Kind| {
            for &(map, lost) in &maps {
                let family = WallFamily::of(&self.problem, map, lost, &self.options.maps);
                let Some(member) = family.and_then(|family| pick(&family)) else {
                    continue;
                };
                let refined = self.refine_member(member, &found.map, noise, progress)?;
                if let Some(map) = refined
                    && self.has_shape(&map, kind, noise)
                {
                    return Ok(Some(map));
                }
            }
            Ok(None)
        };
        let mut telling = member(&WallFamily::aligned, Kind::LinesOfViewsAndOfLandmarks)?;
        if telling.is_none() {
            telling = member(&WallFamily::compact, Kind::CollinearLandmarks)?;
        }
        let telling = telling.or_else(|| self.midpoint_map(&found.map, &others, noise));
        Ok(telling.map(|map| (map, Vec::new())))
    }

    /// A given map. If it has no shape: what the bearings show by themselves, or a nearby map that explains them as
    /// well, with its landmarks exactly on a wall or, if there are four, on a circle.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when `progress` says so.
    pub fn choose_given(
        &self,
        map: Map,
        hopeless: bool,
        progress: &mut Option<Progress<'_>>,
    ) -> Result<Chosen, Error> {
        let stated = self.stated_noise();
        let (_, estimated) = self.rms_and_noise(&map);
        let noise = stated.unwrap_or(estimated);
        let mut lost = self.infinite(&map, noise);
        let mut map = map;
        let mut margin = f64::NAN;
        if !hopeless {
            let known = self.examined(&map, noise);
            if known.is_some_and(|known| known.causes.is_empty()) {
                if let Some(shown) =
                    self.shown_by_bearings(f64::min(noise, self.options.maps.max_unstated_noise))
                {
                    return Ok(shown);
                }
                let family = WallFamily::of(&self.problem, &map, &lost, &self.options.maps);
                let mut member = None;
                if let Some(compact) = family.and_then(|family| family.compact()) {
                    member = self
                        .refine_member(compact, &map, noise, progress)?
                        .filter(|member| self.has_shape(member, Kind::CollinearLandmarks, noise));
                }
                if member.is_none() && self.problem.landmarks() == 4 {
                    let others: Vec<_> = self.explaining_maps(progress)?.collect();
                    member = self.midpoint_map(&map, &others, noise);
                }
                if let Some(member) = member {
                    (map, lost) = (member, Vec::new());
                }
            }
            if self.problem.views() == 3 {
                let best = estimated * self.mean_weight();
                let rivals = mirror_images(&self.problem, &map, progress)?;
                margin = self.margin(best * best, &rivals);
            }
        }
        Ok(Chosen {
            evidence: Evidence::Map { map, lost, margin },
            noise,
        })
    }

    /// How many times larger the residuals of the next best map are, from costs per degree of freedom.
    fn margin(&self, best: f64, rivals: &[f64]) -> f64 {
        let next = rivals.iter().copied().fold(f64::INFINITY, f64::min);
        // The costs of exact maps are rounding.
        let rounding = 16.0 * f64::EPSILON * self.mean_weight();
        let floor = rounding * rounding;
        (f64::max(next, floor) / f64::max(best, floor)).sqrt()
    }
}
