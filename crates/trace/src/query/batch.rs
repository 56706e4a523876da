//! Many rays at once.

use niwaki_core::{Hit, Intersector, Ray};
use rayon::prelude::*;

/// Rays that a thread answers before it looks for more work.
const CHUNK: usize = 1024;

/// As many answers are wanted as there are rays. Remedy: give slices of the same length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{rays} rays, but room for {answers} answers")]
pub struct LengthMismatch {
    /// How many rays were given.
    pub rays: usize,
    /// How many answers there is room for.
    pub answers: usize,
}

/// Batches of rays for anything that answers rays, on one thread or on the current rayon pool.
///
/// [`Intersector::closest_hits`] and [`Intersector::any_hits`] answer batches on the calling
/// thread too, but panic where these return an error.
///
/// ```
/// use niwaki_core::{Bvh, BvhNode, Hit, Ray, TriangleMesh, glam::Vec3};
/// use niwaki_trace::{Batches, WideScene};
///
/// let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])?;
/// let bvh = Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 1)], prim_ids: vec![0] };
/// let scene = WideScene::new(&bvh, &mesh)?;
/// let rays: Vec<Ray> =
///     (0..4).map(|i| Ray::new(Vec3::new(i as f32 * 0.4, 0.1, 1.0), -Vec3::Z)).collect();
/// let mut hits = vec![Hit::MISS; rays.len()];
/// scene.par_closest_hits(&rays, &mut hits)?;
/// assert_eq!(hits.iter().filter(|hit| hit.is_hit()).count(), 3);
/// assert!(scene.par_closest_hits(&rays, &mut hits[..2]).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Batches: Intersector {
    /// [`Intersector::closest_hits`] with an error for slices of different lengths.
    ///
    /// # Errors
    /// [`LengthMismatch`]; nothing is written then.
    fn try_closest_hits(&self, rays: &[Ray], hits: &mut [Hit]) -> Result<(), LengthMismatch> {
        check(rays, hits)?;
        self.closest_hits(rays, hits);
        Ok(())
    }

    /// [`Intersector::any_hits`] with an error for slices of different lengths.
    ///
    /// # Errors
    /// [`LengthMismatch`]; nothing is written then.
    fn try_any_hits(&self, rays: &[Ray], occluded: &mut [bool]) -> Result<(), LengthMismatch> {
        check(rays, occluded)?;
        self.any_hits(rays, occluded);
        Ok(())
    }

    /// The closest hit of each ray, on the current rayon pool; the same for any number of threads.
    ///
    /// # Errors
    /// [`LengthMismatch`]; nothing is written then.
    fn par_closest_hits(&self, rays: &[Ray], hits: &mut [Hit]) -> Result<(), LengthMismatch> {
        check(rays, hits)?;
        rays.par_chunks(CHUNK)
            .zip(hits.par_chunks_mut(CHUNK))
            .for_each(|(rays, hits)| self.closest_hits(rays, hits));
        Ok(())
    }

    /// Whether each ray hits anything, on the current rayon pool; the same for any number of
    /// threads.
    ///
    /// # Errors
    /// [`LengthMismatch`]; nothing is written then.
    fn par_any_hits(&self, rays: &[Ray], occluded: &mut [bool]) -> Result<(), LengthMismatch> {
        check(rays, occluded)?;
        rays.par_chunks(CHUNK)
            .zip(occluded.par_chunks_mut(CHUNK))
            .for_each(|(rays, flags)| self.any_hits(rays, flags));
        Ok(())
    }
}

impl<S: Intersector + ?Sized> Batches for S {}

const fn check<T>(rays: &[Ray], answers: &[T]) -> Result<(), LengthMismatch> {
    if rays.len() == answers.len() {
        Ok(())
    } else {
        Err(LengthMismatch { rays: rays.len(), answers: answers.len() })
    }
}
