#pragma once
#include <string>
#include <vector>

#include "proxcgal/types.hpp"

namespace proxcgal {

/// Which form of [WA] eq. (1) turns a zone's range into a point.
enum class RangeModel : std::uint8_t {
  kTangent,  ///< x = d tan(alpha), y = d tan(beta), z = d: what the sensor measures
  kPrinted,  ///< x = d sin(alpha), as the paper prints it; for comparison only
};

/// Model of one VL53L8CX-like sensor and its noise (facts: data sheet, ST UM3109).
struct SensorModel {
  double field_of_view = 0.7853981633974483;  ///< [rad] along one side, 8 zones
  double min_range = 0.02;                    ///< [m]
  double max_range = 4.0;                     ///< [m]
  double workspace = 1.3;                     ///< [m] along the ray; farther points are cropped
  double sigma_floor = 0.005;                 ///< [m] least standard deviation of a range
  double sigma_ratio = 0.015;                 ///< [-] of the range, where that is more
  RangeModel range_model = RangeModel::kTangent;

  /// @throws ConfigError  with the field, its value and its bounds
  void validate() const;
  double sigma(double range) const;  ///< [m]
  bool operator==(const SensorModel&) const = default;
};

/// Where one sensor sits: z looks out of the link's surface.
struct Mount {
  std::string name;
  std::string link;
  Pose T_LS = Pose::Identity();
};

/// The sensors of a robot, row by row, and the model they share.
struct Skin {
  std::vector<Mount> mounts;
  SensorModel model;
};

/// What a zone said.
enum class ZoneState : std::uint8_t { kTarget, kUncertain, kEmpty, kInvalid };

/// Points of one scan, in the sensor's frame: only zones with a target.
struct SensedPoints {
  int count = 0;
  std::array<Vector3, kZones> point_S;
  std::array<double, kZones> range;  ///< [m] along the ray
  std::array<double, kZones> sigma;  ///< [m] along the ray, larger where the status is uncertain
  std::array<std::uint8_t, kZones> zone;
  int targets = 0;  ///< zones that saw something, in the workspace or beyond
  int invalid = 0;  ///< zones that are neither target nor empty
  int first_invalid_zone = -1;
};

/// Zone ranges to points: [WA] eq. (1).
class Sense {
 public:
  explicit Sense(const SensorModel& model);

  /// Status 5 is a target, 6 and 9 an uncertain one, 255 empty, all else invalid; so is a range
  /// that is not finite or not inside [min_range, max_range].
  ZoneState classify(double range, std::uint8_t status) const;
  void operator()(const Scan& scan, SensedPoints& out) const;

  /// How far along z the workspace goes in a zone: what is farther is not in the cloud [m].
  double farthest(int zone) const;

  /// The point of zone `zone` at `range`, in the sensor's frame [m].
  Vector3 point(int zone, double range) const;

 private:
  SensorModel model_;
  std::array<double, kZones> x_per_range_;
  std::array<double, kZones> y_per_range_;
  std::array<double, kZones> ray_per_range_;  // length along the slanted ray
};

}  // namespace proxcgal
