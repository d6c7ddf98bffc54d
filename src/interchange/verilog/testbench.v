// Checks @NAME@: frame upon frame, then with pauses after a reset with frames on their way.
//     iverilog -o test @NAME@.v @NAME@_tb.v && vvp test
// with @NAME@.v in this folder prints PASS or FAIL.
module @NAME@_tb;
    parameter INPUT = "input.txt";
    parameter EXPECTED = "expected.txt";
    // The outputs of the second pass, one in a line, if this is a name.
    parameter OUTPUT = "";
    parameter FRAMES = @FRAMES@;
@LOAD@    // The words of the bank that begins, and those of the bank from frame SWITCH on.
@LOAD@    parameter LOAD = "load.mem";
@LOAD@    parameter NEXT = "next.mem";
@LOAD@    parameter SWITCH = @SWITCH@;
@LOAD@    localparam WORDS = @WORDS@;
    localparam LATENCY = @LATENCY@;
    localparam CLOCKS = @CLOCKS@;

    reg clk, rst, in_valid;
    wire in_ready, out_valid;
    reg signed [@INPUT_TOP@:0] @INPUTS@;
    wire signed [@OUTPUT_TOP@:0] @OUTPUTS@;
    reg signed [@OUTPUT_TOP@:0] @EXPECTED@;
    // Whether a frame was given in each of the last clocks.
    reg [LATENCY:0] pending;
    reg [31:0] noise;
    // What a line of a file holds.
    integer @READ@;
@LOAD@    reg load_write, commit;
@LOAD@    reg [@ADDRESS_TOP@:0] load_address;
@LOAD@    reg [@DATA_TOP@:0] load_data;
@LOAD@    reg [@DATA_TOP@:0] words [0:WORDS-1];
@LOAD@    integer loaded;
    integer given, wanted, written, pass, sent, received, age, errors, code;

    @NAME@ dut (.clk(clk), .rst(rst), .in_valid(in_valid), .out_valid(out_valid)@PORTS@);
@READY@
    initial clk = 1'b0;
    always #5 clk = ~clk;

    initial begin
        rst = 1'b1;
        in_valid = 1'b0;
        {@INPUTS@} = 0;
        noise = 32'd1;
        errors = 0;
        for (pass = 0; pass < 2; pass = pass + 1) begin
            given = $fopen(INPUT, "r");
            wanted = $fopen(EXPECTED, "r");
            if (given == 0 || wanted == 0) begin
                $display("FAIL: cannot read %0s and %0s", INPUT, EXPECTED);
                $finish;
            end
            written = 0;
            if (pass == 1 && OUTPUT != "") written = $fopen(OUTPUT, "w");
            rst = 1'b1;
@LOAD@            $readmemh(LOAD, words);
@LOAD@            commit = 1'b0;
@LOAD@            load_write = 1'b1;
@LOAD@            for (loaded = 0; loaded < WORDS; loaded = loaded + 1) begin
@LOAD@                load_address = loaded;
@LOAD@                load_data = words[loaded];
@LOAD@                @(negedge clk);
@LOAD@            end
@LOAD@            load_write = 1'b0;
@LOAD@            commit = 1'b1;
@LOAD@            @(negedge clk);
@LOAD@            commit = 1'b0;
@LOAD@            $readmemh(NEXT, words);
@LOAD@            loaded = 0;
            @(negedge clk);
            rst = 1'b0;
            pending = 0;
            sent = 0;
            received = 0;
            age = CLOCKS;
            while (received < FRAMES && errors < 10) begin
                noise = {noise[30:0], noise[31] ^ noise[21] ^ noise[1] ^ noise[0]};
                if (age >= CLOCKS && in_ready !== 1'b1) begin
                    $display("pass %0d: not ready %0d clocks after a frame", pass, age);
                    errors = errors + 1;
                end
                in_valid = in_ready && sent < FRAMES && (pass == 0 || noise[0]);
@LOAD@                // The next words while the first ones run, then noise where the first ones were.
@LOAD@                if (sent == SWITCH && loaded < WORDS) in_valid = 1'b0;
@LOAD@                commit = in_valid ? sent == SWITCH : ~in_ready & noise[1];
@LOAD@                load_write = loaded < WORDS || sent > SWITCH;
@LOAD@                load_address = loaded < WORDS ? loaded : noise % WORDS;
@LOAD@                load_data = loaded < WORDS ? words[loaded] : noise;
@LOAD@                if (loaded < WORDS) loaded = loaded + 1;
                if (in_valid) begin
                    code = $fscanf(given, "@INPUT_FORMAT@", @READ_INPUTS@);
                    {@INPUTS@} = {@CUT_INPUTS@};
                    sent = sent + 1;
                    age = 0;
                end else {@INPUTS@} = ~{@INPUTS@};
                @(negedge clk);
                age = age + 1;
                pending = {pending[LATENCY-1:0], in_valid};
                if (out_valid !== pending[LATENCY-1]) begin
                    $display("pass %0d, frame %0d: out_valid is %b", pass, received, out_valid);
                    errors = errors + 1;
                end
                if (pending[LATENCY-1]) begin
                    code = $fscanf(wanted, "@OUTPUT_FORMAT@", @READ_OUTPUTS@);
                    {@EXPECTED@} = {@CUT_OUTPUTS@};
                    if ({@OUTPUTS@} !== {@EXPECTED@}) begin
                        $display("pass %0d, frame %0d: @OUTPUT_FORMAT@, not @OUTPUT_FORMAT@", pass, received,
                            @OUTPUTS@, @EXPECTED@);
                        errors = errors + 1;
                    end
                    if (written != 0) $fdisplay(written, "@LINES@", @OUTPUTS@);
                    received = received + 1;
                end
            end
            $fclose(given);
            $fclose(wanted);
            if (written != 0) $fclose(written);
            in_valid = 1'b1;
            @(negedge clk);
            @(negedge clk);
        end
        if (errors == 0) $display("PASS: %0d frames, twice", FRAMES);
        else $display("FAIL");
        $finish;
    end
endmodule
