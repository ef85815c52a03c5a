#include "proxcgal/pipeline/sense.hpp"

#include <algorithm>
#include <cmath>

#include "proxcgal/error.hpp"

namespace proxcgal {
namespace {

constexpr int kSide = 8;

// Status codes of the VL53L8CX (ST UM3109): 5 is a valid range; 6 and 9 are about half trusted.
constexpr std::uint8_t kValid = 5, kWrapNotChecked = 6, kLargePulse = 9, kNoTarget = 255;
constexpr double kUncertainSigma = 2.0;  // how much wider an uncertain range is taken to be

double zone_angle(int index, double field_of_view) {
  return (index - 0.5 * (kSide - 1)) * field_of_view / kSide;
}

}  // namespace

void check(const SensorModel& model, const std::string& path) {
  require(model.max_range > model.min_range, path + "max_range",
          detail::with_unit(model.max_range, "m"),
          "above min_range = " + detail::with_unit(model.min_range, "m"));
}

double SensorModel::sigma(double range) const { return std::max(sigma_floor, sigma_ratio * range); }

Sense::Sense(const SensorModel& model) : model_(model) {
  validate(model);
  for (int zone = 0; zone < kZones; ++zone) {
    const double alpha = zone_angle(zone % kSide, model.field_of_view);
    const double beta = zone_angle(zone / kSide, model.field_of_view);
    const auto row = static_cast<std::size_t>(zone);
    // Equation (1). The sensor reports the distance along z, so x is d tan(alpha) where the paper
    // prints d sin(alpha): docs/sources.md.
    x_per_range_[row] =
        model.range_model == RangeModel::kPrinted ? std::sin(alpha) : std::tan(alpha);
    y_per_range_[row] = std::tan(beta);
    ray_per_range_[row] = Vector3(x_per_range_[row], y_per_range_[row], 1.0).norm();
  }
}

ZoneState Sense::classify(double range, std::uint8_t status) const {
  if (status == kNoTarget) return ZoneState::kEmpty;
  if (status != kValid && status != kWrapNotChecked && status != kLargePulse)
    return ZoneState::kInvalid;
  // Written so that a NaN is invalid; zero is neither contact nor free.
  if (!(range >= model_.min_range && range <= model_.max_range && range > 0.0))
    return ZoneState::kInvalid;
  return status == kValid ? ZoneState::kTarget : ZoneState::kUncertain;
}

double Sense::farthest(int zone) const {
  const double along_z = model_.workspace / ray_per_range_[static_cast<std::size_t>(zone)];
  return std::min(along_z, model_.max_range);
}

Vector3 Sense::point(int zone, double range) const {
  const auto row = static_cast<std::size_t>(zone);
  return {range * x_per_range_[row], range * y_per_range_[row], range};
}

void Sense::operator()(const Scan& scan, SensedPoints& out) const {
  out.count = 0;
  out.targets = 0;
  out.invalid = 0;
  out.first_invalid_zone = -1;
  for (int zone = 0; zone < kZones; ++zone) {
    const double range = scan.ranges[static_cast<std::size_t>(zone)];
    const ZoneState state = classify(range, scan.status[static_cast<std::size_t>(zone)]);
    if (state == ZoneState::kInvalid) {
      if (out.invalid++ == 0) out.first_invalid_zone = zone;
    }
    if (state != ZoneState::kTarget && state != ZoneState::kUncertain) continue;
    ++out.targets;
    const double ray_per_range = ray_per_range_[static_cast<std::size_t>(zone)];
    const double along_ray = range * ray_per_range;
    if (along_ray > model_.workspace) continue;
    const auto i = static_cast<std::size_t>(out.count++);
    out.point_S[i] = point(zone, range);
    out.range[i] = along_ray;
    out.zone[i] = static_cast<std::uint8_t>(zone);
    // The noise is that of the range; along the slanted ray it is longer by the same factor.
    out.sigma[i] = model_.sigma(range) * ray_per_range *
                   (state == ZoneState::kUncertain ? kUncertainSigma : 1.0);
  }
}

}  // namespace proxcgal
