#pragma once
#include "proxcgal/pipeline/filter.hpp"
#include "proxcgal/robot.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// Algorithm 2 of [WA]: the nearest (cloud point, surface point) over the links asked for.
/// @param links  rows to look at; empty means all
/// @return       `found()` is false for an empty cloud
ClosestPair closest_pair(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                         Method method, std::span<const int> links = {});

/// The nearest pair of each link of `links` (all where empty), in that order.
/// @param[out] out  one per link
void closest_pairs(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                   std::span<const int> links, std::span<ClosestPair> out);

}  // namespace proxcgal
