#pragma once
#include "proxcgal/types.hpp"

namespace proxcgal::detail {

/// Share of the nominal motion (what the arm does on its own account) that the mode allows.
///
/// It falls as fast as the joints brake, and rises over a ramp. Retreat has all of its rate in
/// every mode but STOP.
class NominalSpeed {
 public:
  /// @param degraded  share while degraded
  /// @param ramp      [s] from 0 to 1
  NominalSpeed(double degraded, double ramp) : degraded_(degraded), ramp_(ramp) {}

  /// @param elapsed  [s] since the last tick
  /// @param braking  [s] until all joints rest from the last command
  void update(Mode mode, double elapsed, double braking);
  double share() const { return share_; }

 private:
  double degraded_, ramp_;
  double share_ = 1.0;
};

}  // namespace proxcgal::detail
