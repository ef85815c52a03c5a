#pragma once
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace proxcgal {

/// Root of everything that set-up may throw. The tick throws nothing: it returns findings.
class ProxError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A setting that is out of bounds or contradicts another.
class ConfigError : public ProxError {
 public:
  using ProxError::ProxError;
};

/// A robot description that cannot be turned into a robot.
class ModelError : public ProxError {
 public:
  using ProxError::ProxError;
};

/// A mesh, point or array that no query can be asked of.
class GeometryError : public ProxError {
 public:
  using ProxError::ProxError;
};

/// A setting's bound, checked at set-up.
/// @throws ConfigError  naming the field, its value and what it must be
template <class Value>
void require(bool good, std::string_view field, const Value& value, const std::string& bound) {
  if (good) return;
  std::ostringstream message;
  message << field << " is " << value << ", must be " << bound;
  throw ConfigError(message.str());
}

}  // namespace proxcgal
