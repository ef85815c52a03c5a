# The innermost loops once more for processors with AVX2, chosen at run time. Not without
# optimisation: what the compiler then leaves out of line would be shared with the other files, and
# the linker might pick the newer code for all.
set(proxcgal_avx2_file ${CMAKE_CURRENT_SOURCE_DIR}/cpp/src/geometry/kernels_avx2.cpp)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$" AND NOT CMAKE_BUILD_TYPE STREQUAL "Debug"
   AND NOT PROXCGAL_SANITIZE)
  set_source_files_properties(${proxcgal_avx2_file} PROPERTIES COMPILE_OPTIONS -mavx2)
  target_compile_definitions(proxcgal_core PRIVATE PROXCGAL_HAS_AVX2)
else()
  set_source_files_properties(${proxcgal_avx2_file} PROPERTIES HEADER_FILE_ONLY ON)
endif()
