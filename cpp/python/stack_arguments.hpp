#pragma once
#include <cmath>
#include <sstream>

#include "convert.hpp"
#include "proxcgal/types.hpp"

/// Arguments of the solver and the command stage, checked against one another.
namespace proxcgal::binding {

/// Every value between two bounds; what is not even a number is no such array.
inline void require_between(const Eigen::VectorXd& values, const char* name, double low,
                            double high, const char* bound) {
  for (const double value : values) {
    if (std::isnan(value)) throw GeometryError(std::string(name) + " is not finite");
    if (value >= low && value <= high) continue;
    std::ostringstream message;
    message << name << " has the value " << value << ", must be " << bound;
    throw ConfigError(message.str());
  }
}

/// Limits may be infinite, never NaN.
inline JointVector limits_from(nb::handle value, const char* name, Eigen::Index n, double low,
                               const char* bound) {
  const Eigen::VectorXd limits = vector_from(value, name, n, Take::kConvert, false);
  require_between(limits, name, low, kInfinity, bound);
  return limits;
}

inline void require_joints(const std::vector<Task>& tasks, Eigen::Index n) {
  for (std::size_t k = 0; k < tasks.size(); ++k) {
    const Eigen::Index columns = tasks[k].jacobian.cols();
    if (columns == n) continue;
    throw GeometryError("tasks[" + std::to_string(k) + "].jacobian has " + std::to_string(columns) +
                        " columns, expected " + std::to_string(n));
  }
}

}  // namespace proxcgal::binding
