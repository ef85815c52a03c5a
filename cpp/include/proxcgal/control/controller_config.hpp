#pragma once
#include <optional>
#include <string>
#include <vector>

#include "proxcgal/perception/memory.hpp"
#include "proxcgal/perception/motion.hpp"
#include "proxcgal/pipeline/filter.hpp"
#include "proxcgal/pipeline/sense.hpp"
#include "proxcgal/pipeline/solve.hpp"
#include "proxcgal/pipeline/task.hpp"
#include "proxcgal/safety/monitor.hpp"

namespace proxcgal {

/// What the avoidance task moves.
enum class ControlPoint : std::uint8_t {
  kWholeBody,  ///< the surface point nearest to the cloud, any link
  kSensor,     ///< the mounting point of the sensor nearest to the cloud (SM baseline)
};

struct ControllerConfig {
  ControlPoint control_point = ControlPoint::kWholeBody;
  std::vector<TaskSpec> tasks = {Avoidance{}, Reach{}};  ///< the order is the priority
  FilterConfig filter;
  SolverConfig solver;
  MonitorConfig monitor;
  double period = 0.01;                  ///< [s] nominal time from tick to tick
  double min_row_norm = 0.05;            ///< a link whose row n'J is smaller is passed over
  std::vector<std::string> avoid_links;  ///< empty: every link that some joint moves
  Method method = Method::kFast;
  int max_points = 200000;  ///< storage for known points, made at set-up
  bool timings = false;
  std::optional<MemoryConfig> memory;  ///< of what left the sensors' view; none: as in the paper
  std::optional<MotionConfig> motion;  ///< x_o of eq. (4) from the scans; none: taken for zero

  /// @throws ConfigError  with the field, its value and what is allowed
  void validate() const;
};

}  // namespace proxcgal
