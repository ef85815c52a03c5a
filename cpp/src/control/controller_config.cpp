#include "proxcgal/control/controller_config.hpp"

#include "proxcgal/error.hpp"

namespace proxcgal {

void ControllerConfig::validate() const {
  require(!tasks.empty() && tasks.size() <= kMaxLevels, "tasks", tasks.size(),
          "1 to " + std::to_string(kMaxLevels) + " in number");
  for (const TaskSpec& task : tasks) proxcgal::validate(task);
  filter.validate();
  solver.validate();
  monitor.validate();
  if (memory) memory->validate();
  if (motion) motion->validate();
  require(period > 0.0 && period <= 0.5, "period", period, "above 0 and at most 0.5 s");
  require(min_row_norm >= 0.0 && min_row_norm < 1.0, "min_row_norm", min_row_norm,
          "at least 0 and below 1");
  require(max_points >= 1, "max_points", max_points, "1 or more");
}

}  // namespace proxcgal
