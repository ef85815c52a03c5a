#pragma once
#include <array>
#include <string>
#include <vector>

#include "proxcgal/fields.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// Which form of [WA] eq. (1) turns a zone's range into a point.
enum class RangeModel : std::uint8_t {
  kTangent,  ///< x = d tan(alpha), y = d tan(beta), z = d: what the sensor measures
  kPrinted,  ///< x = d sin(alpha), as the paper prints it; for comparison only
};

template <>
inline constexpr auto choices<RangeModel> =
    std::array{Choice{"tangent", RangeModel::kTangent}, Choice{"printed", RangeModel::kPrinted}};

/// Model of one VL53L8CX-like sensor and its noise (facts: data sheet, ST UM3109).
struct SensorModel {
  double field_of_view = 0.7853981633974483;
  double min_range = 0.02;
  double max_range = 4.0;
  double workspace = 1.3;
  double sigma_floor = 0.005;
  double sigma_ratio = 0.015;
  RangeModel range_model = RangeModel::kTangent;

  double sigma(double range) const;  ///< [m] standard deviation
  bool operator==(const SensorModel&) const = default;
};

template <>
inline constexpr auto fields<SensorModel> = field_table(
    "SensorModel",
    "Model of one VL53L8CX-like sensor: 8 x 8 zones, distance along its z axis. SI units.",
    field(&SensorModel::field_of_view, "field_of_view", "rad", above(0).below(3),
          "Field of view along one side of the 8 x 8 zones."),
    field(&SensorModel::min_range, "min_range", "m", at_least(0),
          "Least range, along the sensor's z axis."),
    field(&SensorModel::max_range, "max_range", "m", above(0),
          "Largest range, along the sensor's z axis."),
    field(&SensorModel::workspace, "workspace", "m", above(0).or_infinite(),
          "Points farther along the ray are cropped."),
    field(&SensorModel::sigma_floor, "sigma_floor", "m", at_least(0),
          "Least standard deviation of a range."),
    field(&SensorModel::sigma_ratio, "sigma_ratio", "", at_least(0),
          "Standard deviation as a share of the range, where that is more than the floor."),
    field(&SensorModel::range_model, "range_model",
          "Form of [WA] eq. (1): x = d tan(alpha), as the sensor measures, or x = d sin(alpha), as "
          "printed."));
void check(const SensorModel& model, const std::string& path);

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
