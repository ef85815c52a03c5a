#pragma once
#include <cstdlib>

namespace proxcgal::test {

/// How often: the short form is in every run of the tests, the long one where PROXCGAL_LONG is set,
/// as `./run test --long` does.
inline int repeats(int few, int many) {
  return std::getenv("PROXCGAL_LONG") != nullptr ? many : few;
}

}  // namespace proxcgal::test
