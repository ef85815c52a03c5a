# cmake -DOBJECTS=... -DNM=... -P: fails where the AVX2 kernels' object holds code that the linker
# may share with other files (weak symbols), because an older processor could then meet it.
foreach(object IN LISTS OBJECTS)
  if(NOT object MATCHES "kernels_avx2")
    continue()
  endif()
  execute_process(COMMAND ${NM} --defined-only ${object} OUTPUT_VARIABLE symbols
                  COMMAND_ERROR_IS_FATAL ANY)
  if(symbols MATCHES "[0-9a-f]+ [WVuw] ([^\n]*)")
    message(FATAL_ERROR "${object} shares ${CMAKE_MATCH_1}")
  endif()
  message(STATUS "${object} shares no code")
endforeach()
