#include "proxcgal/guiding/admittance.hpp"

#include <algorithm>
#include <cmath>

namespace proxcgal {
namespace {

/// One axis over a time without a change of sign: its velocity at the end, and its way.
struct Piece {
  double velocity = 0.0, way = 0.0;
};

Piece solve(double mass, double damping, double force, double velocity, double dt) {
  const double rate = damping / mass;
  const double limit = force / damping;
  const double decayed = -std::expm1(-rate * dt);  // 1 - exp(-D dt / M)
  return {velocity + (limit - velocity) * decayed,
          limit * dt + (velocity - limit) * decayed / rate};
}

/// When the velocity reaches zero under a force against it [s].
double time_to_rest(double mass, double damping, double force, double velocity) {
  return mass / damping * std::log1p(-velocity * damping / force);
}

}  // namespace

Admittance::Admittance(const AdmittanceConfig& config) : config_(config) { validate(config); }

const Vector6& Admittance::step(const Vector6& force, bool engaged, double dt) {
  const double ramp = config_.engage_time > 0.0 ? dt / config_.engage_time : 1.0;
  engagement_ = std::clamp(engagement_ + (engaged ? ramp : -ramp), 0.0, 1.0);
  for (int axis = 0; axis < 6; ++axis) {
    const double mass = config_.mass[axis], damping = config_.damping[axis];
    const double given = std::isfinite(force[axis]) ? force[axis] : 0.0;
    const double beyond = std::max(std::abs(given) - config_.dead_band[axis], 0.0);
    const double driving =
        engagement_ * std::copysign(std::min(beyond, config_.max_force[axis]), given);
    double velocity = velocity_[axis], left = dt, way = 0.0;
    if (velocity * given < 0.0) {  // the hand brakes: all of its force, until rest
      const double braking = std::min(time_to_rest(mass, damping, given, velocity), left);
      const Piece piece = solve(mass, damping, given, velocity, braking);
      way = piece.way;
      left -= braking;
      velocity = left > 0.0 ? 0.0 : piece.velocity;
    }
    const Piece piece = solve(mass, damping, driving, velocity, left);
    if (left > 0.0) {
      velocity = piece.velocity;
      way += piece.way;
    }
    velocity_[axis] = velocity;
    mean_[axis] = way / dt;
  }
  return mean_;
}

void Admittance::held_to(const Vector6& achieved) {
  for (int axis = 0; axis < 6; ++axis) {
    const double share = mean_[axis] != 0.0 ? achieved[axis] / mean_[axis] : 1.0;
    if (std::isfinite(share)) velocity_[axis] *= std::clamp(share, 0.0, 1.0);
  }
}

double Admittance::energy() const {
  return 0.5 * velocity_.dot(config_.mass.cwiseProduct(velocity_));
}

}  // namespace proxcgal
