#pragma once
#include <sstream>
#include <string>

#include "proxcgal/error.hpp"

namespace proxcgal {

/// A setting's bound, checked at set-up.
/// @throws ConfigError  naming the field, its value and what it must be
template <class Value>
void require(bool good, const char* field, const Value& value, const std::string& bound) {
  if (good) return;
  std::ostringstream message;
  message << field << " is " << value << ", must be " << bound;
  throw ConfigError(message.str());
}

}  // namespace proxcgal
