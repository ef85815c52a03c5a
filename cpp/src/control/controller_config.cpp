#include "proxcgal/control/controller_config.hpp"

namespace proxcgal {

void check(const ControllerConfig& config, const std::string&) {
  if (!config.limit.distances) return;
  for (const TaskSpec& task : config.tasks) {
    if (const auto* avoidance = std::get_if<Avoidance>(&task))
      config.limit.require_stable(avoidance->gain, config.period);
    if (const auto* own = std::get_if<SelfCollision>(&task))
      config.limit.require_stable(own->gain, config.period);
  }
}

}  // namespace proxcgal
