# What every file of ours is compiled with. Never -ffast-math: it breaks the checks for NaN.
# -ffp-contract=off keeps a replay bit-equal, whatever the instruction set.
add_library(proxcgal_flags INTERFACE)
target_compile_options(
  proxcgal_flags
  INTERFACE -ffp-contract=off -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor
            -Woverloaded-virtual -Wdouble-promotion -Wvla
            $<$<BOOL:${PROXCGAL_MARCH}>:-march=${PROXCGAL_MARCH}>)
# No -Wconversion: Eigen's rows and columns are signed, the standard library's sizes are not.

if(PROXCGAL_SANITIZE)
  target_compile_options(proxcgal_flags INTERFACE -fsanitize=${PROXCGAL_SANITIZE}
                                                  -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(proxcgal_flags INTERFACE -fsanitize=${PROXCGAL_SANITIZE})
endif()
