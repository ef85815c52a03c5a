#include "bind_fields.hpp"
#include "proxcgal/control/controller_config.hpp"
#include "topics.hpp"

namespace proxcgal::binding {

void bind_config(nb::module_& m) {
  bind_fields<FilterConfig>(m);
  bind_fields<MonitorConfig>(m);
  bind_fields<LimitConfig>(m).def_static(
      "papers", &LimitConfig::papers,
      "The papers' law within the joints' limits: no approach cap on what is seen, no retreat.");
  bind_fields<MemoryConfig>(m);
  bind_fields<MotionConfig>(m);
  bind_fields<ControllerConfig, Access::kReadOnly, 2>(m);
}

}  // namespace proxcgal::binding
