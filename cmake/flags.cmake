# What every file of ours is compiled with. Never -ffast-math: it breaks the checks for NaN.
# -ffp-contract=off keeps a replay bit-equal, whatever the instruction set.
add_library(proxcgal_flags INTERFACE)
target_compile_options(
  proxcgal_flags
  INTERFACE -ffp-contract=off -Wall -Wextra -Wpedantic -Wshadow=local -Wnon-virtual-dtor
            -Woverloaded-virtual -Wdouble-promotion -Wvla
            $<$<BOOL:${PROXCGAL_MARCH}>:-march=${PROXCGAL_MARCH}>)
# Left out on purpose: -Wconversion, as Eigen's sizes are signed and the standard library's are not;
# -Wmissing-field-initializers, as a field that is not named keeps its default; -Wpsabi, as wide
# vectors pass between functions of one library only; GCC's -Wrestrict, which GCC 12 raises inside
# std::string for nothing.
target_compile_options(proxcgal_flags INTERFACE -Wno-missing-field-initializers -Wno-psabi
                                                 $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)

if(PROXCGAL_SANITIZE)
  target_compile_options(proxcgal_flags INTERFACE -fsanitize=${PROXCGAL_SANITIZE}
                                                  -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(proxcgal_flags INTERFACE -fsanitize=${PROXCGAL_SANITIZE})
endif()
