#include "proxcgal/pipeline/task_config.hpp"

#include <iterator>

namespace proxcgal {

void check(const Manipulability& config, const std::string& path) {
  require(config.high > config.low, path + "high", config.high,
          "above low = " + detail::with_unit(config.low, ""));
  require(config.joints == 0 || config.joints >= 6, path + "joints", config.joints,
          "0 (all) or between 6 and " + std::to_string(kMaxJoints));
}

const char* task_name(const TaskSpec& spec) {
  constexpr const char* names[] = {"avoidance",        "reach",          "joint_limits",
                                   "minimum_altitude", "manipulability", "self_collision"};
  static_assert(std::size(names) == std::variant_size_v<TaskSpec>);
  const auto* reach = std::get_if<Reach>(&spec);
  if (reach != nullptr && reach->rows == ReachRows::kPosition) return "reach_position";
  if (reach != nullptr && reach->rows == ReachRows::kOrientation) return "reach_orientation";
  return names[spec.index()];
}

void validate(const TaskSpec& spec) {
  std::visit([](const auto& task) { validate(task); }, spec);
}

}  // namespace proxcgal
