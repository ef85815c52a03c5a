#include "allocations.hpp"

#include <cerrno>
#include <cstdlib>

// malloc itself is interposed, so that Eigen, KDL, CGAL and the standard library are all counted.
// Sanitizers bring a malloc of their own and must keep it: there nothing is counted.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
#define PROXCGAL_COUNTS 0
#else
#define PROXCGAL_COUNTS 1
#endif

namespace {
thread_local bool counting = false;
thread_local std::size_t counted = 0;
[[maybe_unused]] void note() {
  if (counting) ++counted;
}
}  // namespace

#if PROXCGAL_COUNTS
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t n, std::size_t size);
void* __libc_realloc(void* p, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void* malloc(std::size_t size) {
  note();
  return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) {
  note();
  return __libc_calloc(n, size);
}
void* realloc(void* p, std::size_t size) {
  note();
  return __libc_realloc(p, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  note();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
  note();
  *out = __libc_memalign(alignment, size);
  return *out != nullptr ? 0 : ENOMEM;
}
}
#endif

namespace proxcgal::test {

CountAllocations::CountAllocations() {
  counted = 0;
  counting = true;
}
CountAllocations::~CountAllocations() { counting = false; }
std::size_t CountAllocations::count() const { return counted; }

}  // namespace proxcgal::test
