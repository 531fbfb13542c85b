% Responses of an exported linear model in GNU Octave: octave respond_octave.m CRAFT.m CASES.json
%
% Prints the poles of the plant, the frequency responses of its channels, and what small steps of an input become, as JSON.
1;
pkg load control

function pairs = parts(values)
  pairs = [real(values(:)), imag(values(:))];
end

arguments = argv();
cases = jsondecode(fileread(arguments{2}));
source(arguments{1});

told.poles = parts(eig(plant.A));
names = fieldnames(channels);
for k = 1:numel(names)
  told.channels.(names{k}) = parts(squeeze(freqresp(channels.(names{k}), cases.frequencies_rad_s)));
end
for k = 1:numel(cases.steps)
  one = cases.steps(k);
  row = find(strcmp(states, one.output));
  column = find(strcmp(inputs, one.input));
  time = linspace(0, one.duration_s, 201)';
  response = lsim(plant_with_rotors(row, column), one.size * ones(size(time)), time);
  told.steps(k) = response(end);
end
puts(jsonencode(told));
