#include "bind_fields.hpp"
#include "proxcgal/control/controller_config.hpp"
#include "topics.hpp"

namespace proxcgal::binding {

void bind_config(nb::module_& m) {
  bind_fields<FilterConfig>(m);
  bind_fields<MonitorConfig>(m);
  bind_fields<MemoryConfig>(m);
  bind_fields<MotionConfig>(m);
  bind_fields<ControllerConfig, Access::kReadOnly, 2>(m);
}

}  // namespace proxcgal::binding
