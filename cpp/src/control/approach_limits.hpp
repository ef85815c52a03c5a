#pragma once
#include <array>

#include "perception/perception.hpp"
#include "proxcgal/control/controller_config.hpp"
#include "proxcgal/control/tick_output.hpp"
#include "proxcgal/pipeline/command.hpp"
#include "trusted_distance.hpp"

namespace proxcgal::detail {

/// Motion that no command may contain: towards an obstacle inside d_min, or fast into a region
/// that a silent sensor covered.
class ApproachLimits {
 public:
  ApproachLimits(const Robot& robot, const Skin& skin, const ControllerConfig& config);

  /// Changes the command as little as possible so that the pair inside d_min does not come nearer.
  void keep_off(const Posture& posture, const TrustedDistance& trusted, const Admissible& box,
                TickOutput& out) const;
  /// Slows motion into a silent sensor's view, and reports it once the sensor has been silent for
  /// `hold_after`.
  void slow_into_unseen(double time, const Posture& posture, const Perception& perception,
                        const Admissible& box, TickOutput& out, Monitor& monitor) const;

 private:
  const Robot& robot_;
  MonitorConfig config_;
  bool whole_body_;
  std::array<Vector3, 5> view_S_;  // middle and corners of a field of view
};

}  // namespace proxcgal::detail
