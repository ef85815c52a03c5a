#pragma once
#include <array>

#include "proxcgal/fields.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

using Vector6 = Eigen::Matrix<double, 6, 1>;  ///< linear first, then angular

/// M a + D v = F, axis by axis: the linear ones and the angular ones, in world.
struct AdmittanceConfig {
  Vector6 mass = (Vector6() << 8, 8, 8, 0.3, 0.3, 0.3).finished();
  Vector6 damping = (Vector6() << 35, 35, 35, 2, 2, 2).finished();
  Vector6 dead_band = (Vector6() << 2, 2, 2, 0.2, 0.2, 0.2).finished();
  Vector6 max_force = (Vector6() << 150, 150, 150, 20, 20, 20).finished();
  double engage_time = 0.3;
};

template <>
inline constexpr auto fields<AdmittanceConfig> = field_table(
    "AdmittanceConfig", "M a + D v = F: three linear and three angular axes, in world.",
    field(&AdmittanceConfig::mass, "mass", "kg, kg m^2", above(0), "M of each axis."),
    field(&AdmittanceConfig::damping, "damping", "N s/m, N m s/rad", above(0), "D of each axis."),
    field(&AdmittanceConfig::dead_band, "dead_band", "N, N m", at_least(0),
          "Force on each axis below which the hand drives nothing."),
    field(&AdmittanceConfig::max_force, "max_force", "N, N m", above(0),
          "Largest driving force on each axis."),
    field(&AdmittanceConfig::engage_time, "engage_time", "s", at_least(0),
          "Ramp in which the hand is let in, and let go."));

/// Hand guiding: the tool moves like a mass in a viscous medium that the hand pushes.
///
/// Passive at the handle: the energy that it gives back never exceeds what the hand has put in.
/// Dead band, force limit and the ramp of engaging weaken the hand only where it drives; where it
/// brakes, all of its force counts. (Weakened there too, the mass would keep energy that the hand
/// was made to take.) The velocity is continuous whatever the switch does. Allocates nothing.
class Admittance {
 public:
  /// @throws ConfigError
  explicit Admittance(const AdmittanceConfig& config);

  /// One cycle under a constant force, solved exactly.
  /// @param force    at the handle, in world [N], [N m]; what is not finite counts as none
  /// @param engaged  the hand's switch
  /// @param dt       [s] above 0
  /// @return         mean velocity over the cycle: with it, force times way is the work done
  const Vector6& step(const Vector6& force, bool engaged, double dt);

  /// What became of the last step's velocity: axes that were held back lose the energy, none
  /// gains any.
  void held_to(const Vector6& achieved);
  void stop() { velocity_.setZero(); }

  const Vector6& velocity() const { return velocity_; }  ///< at the end of the cycle
  double energy() const;                                 ///< [J] kinetic
  double engagement() const { return engagement_; }      ///< 0 let go, 1 let in

 private:
  AdmittanceConfig config_;
  Vector6 velocity_ = Vector6::Zero();
  Vector6 mean_ = Vector6::Zero();
  double engagement_ = 0.0;
};

}  // namespace proxcgal
