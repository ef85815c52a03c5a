#include "fuzz/mesh.hpp"

#include <cstdio>
#include <cstdlib>

/// libFuzzer: meshes, and what is asked of them.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto run = proxcgal::fuzz::run_mesh(data, size);
  if (!run.violation.empty()) {
    std::fprintf(stderr, "violated: %s\n", run.violation.c_str());
    std::abort();
  }
  return 0;
}
