#pragma once
#include "obstacle_velocities.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "proxcgal/pipeline/task.hpp"
#include "proxcgal/robot.hpp"

namespace proxcgal::detail {

/// A nearest pair with the sign of its distance: negative where the obstacle is inside the link.
/// Where the two points coincide, the normal leads out from the link's centre.
ControlPair signed_pair(const Robot& robot, const Posture& posture, const ClosestPair& pair,
                        const ObstacleVelocities& velocities);

/// The nearest of the points on the other side of a link: beyond the plane through the surface
/// point of `control`, in the direction that leads away from its obstacle.
/// @param within  [m] only a nearer pair counts
ClosestPair other_side(const Robot& robot, const Posture& posture, const PointsRef& cloud_W,
                       const ControlPair& control, double within);

}  // namespace proxcgal::detail
